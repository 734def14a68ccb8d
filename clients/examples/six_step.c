/* Six-step commutation without a sensor of the rotor: a board support file, the firmware, and the timer that
 * calls its interrupt once in a PWM period. The rotor is aligned, turned open loop until its emf shows, and
 * from then on commutated by the comparators of the open phase alone, 3/8 of a step after each crossing.
 * Argument: the address of a bench (esc). */
#include <drivebench.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

/* ---- board support: power stage, comparators, a timer of 10 MHz ---- */

#define TICK 200u /* counts of the timer in a PWM period of 20 us */

static drivebench_bench* bench;
static drivebench_sample sensors;
static drivebench_command command;

/* One leg switches, the others stay at the negative rail; one of these may be off. */
static void pwm_set(int high, unsigned off, float duty) {
  double set[3] = {0.0, 0.0, 0.0};
  set[high] = (double)duty;
  command.gates = DRIVEBENCH_GATES_DUTY;
  command.legs_off = off;
  command.setpoint_a = set[0], command.setpoint_b = set[1], command.setpoint_c = set[2];
}

static uint32_t timer_read(void) {
  return (uint32_t)sensors.tick * TICK;
}
static int comparator_level(int phase) {
  return (int)(sensors.comparator_levels >> phase & 1u);
}
/* The capture register: the timer at the last edge. */
static uint32_t comparator_capture(int phase) {
  const double age_s[3] = {sensors.comparator_a_age_s, sensors.comparator_b_age_s,
                           sensors.comparator_c_age_s};
  return timer_read() - (uint32_t)lround(age_s[phase] * 1e7);
}

/* ---- the firmware ---- */

#define POLE_PAIRS 7
#define START_DUTY 0.08f
#define ALIGN_COUNTS 3000000u                           /* 300 ms */
#define FIRST_STEP 200000u                              /* 20 ms: 71 rpm */
#define LAST_STEP 25000u                                /* 2.5 ms: 571 rpm */
#define GOOD_STEPS 6                                    /* in a row, before the comparators take over */
#define RPM_COUNTS (1e7f * 60.0f / (6.0f * POLE_PAIRS)) /* rpm times the counts of a step */

typedef struct {
  int high, low, open, rises;
} Step;
static const Step kSteps[6] = {{1, 2, 0, 0}, {1, 0, 2, 1}, {2, 0, 1, 0},
                               {2, 1, 0, 1}, {0, 1, 2, 0}, {0, 2, 1, 1}};

static enum { kAlign, kRamp, kRun } state;
static int step = 2, crossed, good, lost, commutations;
static uint32_t step_counts, commutated, commutate_at, last_crossing;
static float duty = START_DUTY, integral, target_rpm, reference_rpm, speed_rpm;

static void commutate(uint32_t now) {
  step = (step + 1) % 6;
  commutated = now;
  crossed = 0;
  ++commutations;
}

/* Whether the open phase crosses the neutral, and when. Its current dies in a diode first: until then the
 * comparator does not count. A quarter of a step is too little where the motor speeds up. */
static int crossing(uint32_t now, uint32_t* at) {
  const uint32_t blanking = (state == kRun ? 3 : 2) * step_counts / 8, since = now - commutated;
  const int open = kSteps[step].open;
  if (crossed || since < blanking || comparator_level(open) != kSteps[step].rises) return 0;
  *at = comparator_capture(open);
  if (now - *at > since - blanking) *at = now; /* it has been there before */
  crossed = 1;
  return 1;
}

static void control_speed(void) {
  const float error = reference_rpm - speed_rpm;
  reference_rpm = fminf(target_rpm, reference_rpm + 0.5f); /* 25,000 rpm/s */
  duty = integral + 1e-4f * error;
  if (duty > 0.05f && duty < 1.0f) integral += 1e-6f * error;
  duty = fminf(fmaxf(duty, 0.05f), 1.0f);
}

static void control_interrupt(void) {
  const uint32_t now = timer_read();
  uint32_t at;
  if (state == kAlign && now >= ALIGN_COUNTS) {
    state = kRamp; /* the magnet stands along phase b: in the middle of step 2 */
    step_counts = FIRST_STEP;
    commutated = now - FIRST_STEP / 2;
    commutate_at = now + FIRST_STEP / 2;
  }
  if (state == kRamp) {
    if (crossing(now, &at)) {
      /* in the middle half of a step: the rotor follows, and its emf shows */
      const uint32_t since = at - commutated;
      good = step_counts <= LAST_STEP && since < 3 * step_counts / 4 ? good + 1 : 0;
      last_crossing = at;
      if (good >= GOOD_STEPS) {
        state = kRun;
        integral = duty;
        speed_rpm = reference_rpm = RPM_COUNTS / (float)step_counts;
        commutate_at = at + step_counts / 2;
      }
    }
    if (state == kRamp && (int32_t)(now - commutate_at) >= 0) {
      if (!crossed) good = 0;
      commutate(now);
      if (step_counts > LAST_STEP) step_counts -= step_counts / 24;
      commutate_at += step_counts;
    }
  } else if (state == kRun) {
    if (crossing(now, &at)) {
      step_counts = (3 * step_counts + (at - last_crossing)) / 4;
      last_crossing = at;
      speed_rpm = RPM_COUNTS / (float)step_counts;
      commutate_at =
          at + step_counts * 3 / 8; /* half a step, less 7.5 degrees for the current to turn over */
    } else if (!crossed && now - commutated > 2 * step_counts) {
      ++lost; /* none came: on with the pace of before */
      last_crossing = now - step_counts / 2;
      commutate_at = now;
      crossed = 1;
    }
    control_speed();
    /* what is set now acts from the next period on */
    if (crossed && (int32_t)(now + TICK + TICK / 2 - commutate_at) >= 0) commutate(now + TICK);
  }
  /* With all legs on, the swing of the rotor about its axis drives a current, and dies. */
  if (state == kAlign) {
    pwm_set(1, 0, duty);
  } else {
    pwm_set(kSteps[step].high, 1u << kSteps[step].open, duty);
  }
}

/* ---- the bench: the timer that calls the interrupt, and the load ---- */

#define RUN_TICKS 100000u /* 2 s */
#define STEP_TICK 85000u

int main(int argc, char** argv) {
  double lowest_rpm = 1e9, before_rpm = 0.0;
  uint64_t hash = 0;
  if (drivebench_open(argc > 1 ? argv[1] : "inproc:esc", NULL, &bench) != DRIVEBENCH_OK) {
    return fprintf(stderr, "%s\n", drivebench_error(NULL)), 1;
  }
  drivebench_acquire(bench, 0);
  drivebench_newest(bench, 0, &sensors);
  while (sensors.tick < RUN_TICKS) {
    const double rpm = sensors.speed_rad_s * 9.5492966;
    target_rpm = 10656.0f; /* 80 % of 900 rpm/V times 14.8 V */
    if (sensors.tick == STEP_TICK) {
      before_rpm = rpm;
      drivebench_set_load(bench, 0, 0.015, 0, 0);
    }
    if (sensors.tick > STEP_TICK && rpm < lowest_rpm) lowest_rpm = rpm;
    control_interrupt();
    command.tick = sensors.tick;
    if (drivebench_step(bench, &command, 1, &sensors) != DRIVEBENCH_OK) {
      return fprintf(stderr, "%s\n", drivebench_error(bench)), 1;
    }
  }
  drivebench_state_hash(bench, &hash);
  printf("%.0f rpm before the load step, at least %.0f after it, %.0f at the end\n", before_rpm, lowest_rpm,
         sensors.speed_rad_s * 9.5492966);
  printf("%d commutations, %d without a crossing, hash %016llx\n", commutations, lost,
         (unsigned long long)hash);
  drivebench_close(bench);
  return 0;
}
