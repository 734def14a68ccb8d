/* Six-step commutation without a sensor of the rotor, at gate level: a firmware with timers and comparator
 * interrupts of its own, which sets the modes of the legs when it likes. Between two of its alarms time goes
 * on to the next edge of a comparator, to the picosecond. Argument: the address of a bench (inproc:esc). */
#include <drivebench_bridge.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

/* ---- board support: power stage, comparators, alarms; all times in picoseconds ---- */

#define US 1000000ull
#define MS 1000000000ull
#define NEVER UINT64_MAX
#define PWM_PERIOD (20 * US)
#define DEAD_TIME 200000ull

static drivebench_bridge* bridge;
static uint64_t now;
static int comparator[3];

static void set_leg(int leg, uint32_t mode, float duty) {
  const drivebench_leg setting = {.mode = mode,
                                  .period_ps = PWM_PERIOD,
                                  .compare_ps = (uint64_t)(duty * (float)PWM_PERIOD),
                                  .dead_ps = DEAD_TIME};
  if (drivebench_bridge_set(bridge, (uint32_t)leg, &setting) != DRIVEBENCH_OK) {
    fprintf(stderr, "%s\n", drivebench_bridge_error(bridge));
  }
}

/* ---- the firmware ---- */

#define POLE_PAIRS 7
#define START_DUTY 0.08f
#define ALIGN_TIME (300 * MS)
#define FIRST_STEP (20 * MS)                    /* 71 rpm */
#define LAST_STEP (2500 * US)                   /* 571 rpm */
#define SHORTEST_STEP (60 * US)                 /* 23,800 rpm: never below */
#define GOOD_STEPS 6                            /* in a row, before the comparators take over */
#define RPM_TIME (60e12f / (6.0f * POLE_PAIRS)) /* rpm times the time of a step */

typedef struct {
  int high, low, open, rises;
} Step;
static const Step kSteps[6] = {{1, 2, 0, 0}, {1, 0, 2, 1}, {2, 0, 1, 0},
                               {2, 1, 0, 1}, {0, 1, 2, 0}, {0, 2, 1, 1}};

static enum { kAlign, kRamp, kRun } state;
static int step = 2, crossed, blanked, good, lost, commutations;
static uint64_t step_time = FIRST_STEP, commutated, last_crossing;
static uint64_t commutate_at = NEVER, blanked_at = NEVER, given_up_at = NEVER, control_at = MS; /* alarms */
static float duty = START_DUTY, integral, target_rpm, reference_rpm, speed_rpm;

static void set_legs(void) {
  const Step* is = &kSteps[step];
  if (state == kAlign) {
    /* Along b. With all legs on, the swing of the rotor about its axis drives a current, and dies. */
    set_leg(0, DRIVEBENCH_LEG_LOW, 0.0f);
    set_leg(1, DRIVEBENCH_LEG_PWM, duty);
    set_leg(2, DRIVEBENCH_LEG_LOW, 0.0f);
    return;
  }
  set_leg(is->open, DRIVEBENCH_LEG_OPEN, 0.0f);
  set_leg(is->low, DRIVEBENCH_LEG_LOW, 0.0f);
  set_leg(is->high, DRIVEBENCH_LEG_PWM, duty);
}

static void commutate(void) {
  step = (step + 1) % 6;
  commutated = now;
  crossed = blanked = 0;
  /* Until then the current of the open phase dies in a diode, which looks like a crossing: a quarter of the
   * step is too little where the motor speeds up. */
  blanked_at = now + (state == kRun ? 3 : 2) * step_time / 8;
  given_up_at = state == kRun ? now + 2 * step_time : NEVER;
  commutate_at = state == kRun ? NEVER : now + step_time;
  ++commutations;
  set_legs();
}

/* The open phase crosses the neutral. */
static void crossing(uint64_t at) {
  crossed = 1;
  given_up_at = NEVER;
  if (state == kRamp) {
    /* in the middle half of a step: the rotor follows, and its emf shows */
    good = step_time <= LAST_STEP && at - commutated < 3 * step_time / 4 ? good + 1 : 0;
    if (good >= GOOD_STEPS) {
      state = kRun;
      integral = duty;
      speed_rpm = reference_rpm = RPM_TIME / (float)step_time;
      commutate_at = at + step_time / 2;
    }
  } else if (state == kRun) {
    step_time = (3 * step_time + (at - last_crossing)) / 4;
    if (step_time < SHORTEST_STEP) step_time = SHORTEST_STEP;
    speed_rpm = RPM_TIME / (float)step_time;
    commutate_at = at + step_time * 3 / 8; /* half a step, less 7.5 degrees for the current to turn over */
  }
  last_crossing = at;
}

static void comparator_interrupt(int phase, int level, uint64_t at) {
  comparator[phase] = level;
  if (state != kAlign && blanked && !crossed && phase == kSteps[step].open && level == kSteps[step].rises) {
    crossing(at);
  }
}

static void blanking_alarm(void) {
  blanked_at = NEVER;
  blanked = 1;
  if (!crossed && comparator[kSteps[step].open] == kSteps[step].rises)
    crossing(now); /* it has been there before */
}

static void commutation_alarm(void) {
  commutate_at = NEVER;
  if (state == kRamp) {
    if (!crossed) good = 0;
    if (step_time > LAST_STEP) step_time -= step_time / 24;
  }
  commutate();
}

/* No crossing came: on with the pace of before. */
static void give_up_alarm(void) {
  given_up_at = NEVER;
  ++lost;
  last_crossing = now - step_time / 2;
  commutate();
}

/* Once in a millisecond, at the start of a period. */
static void control_alarm(void) {
  control_at = now + MS;
  if (state == kAlign && now >= ALIGN_TIME) {
    state = kRamp; /* the magnet stands along phase b: in the middle of step 2 */
    commutated = now - FIRST_STEP / 2;
    blanked = 1;
    commutate_at = now + FIRST_STEP / 2;
  }
  if (state == kRun) {
    const float error = reference_rpm - speed_rpm;
    reference_rpm = fminf(target_rpm, reference_rpm + 25.0f); /* 25,000 rpm/s */
    duty = integral + 1e-4f * error;
    if (duty > 0.05f && duty < 1.0f) integral += 5e-5f * error;
    duty = fminf(fmaxf(duty, 0.05f), 1.0f);
  }
  set_legs();
}

/* ---- the scheduler, and the load ---- */

#define RUN_TIME (2000 * MS)
#define STEP_TIME (1700 * MS)

static uint64_t earliest(uint64_t a, uint64_t b) {
  return a < b ? a : b;
}

/* To the next alarm or edge. */
static int go_on(uint64_t end) {
  const uint64_t alarm = earliest(earliest(commutate_at, blanked_at), earliest(given_up_at, control_at));
  drivebench_bridge_edge edge;
  size_t count;
  const int code = drivebench_bridge_run(bridge, earliest(alarm, end), &edge, 1, &count, &now);
  if (code != DRIVEBENCH_OK) return code;
  if (count != 0) {
    if (edge.kind == DRIVEBENCH_EDGE_COMPARATOR)
      comparator_interrupt((int)edge.channel, (int)edge.level, now);
    return code;
  }
  if (now >= blanked_at) blanking_alarm();
  if (now >= commutate_at) commutation_alarm();
  if (now >= given_up_at) give_up_alarm();
  if (now >= control_at) control_alarm();
  return code;
}

static double rpm(void) {
  drivebench_bridge_state is;
  drivebench_bridge_read(bridge, &is);
  return is.speed_rad_s * 9.5492966;
}

int main(int argc, char** argv) {
  double lowest_rpm = 1e9, before_rpm = 0.0;
  drivebench_bridge_means means;
  if (drivebench_bridge_open(argc > 1 ? argv[1] : "inproc:esc", 0, &bridge) != DRIVEBENCH_OK) {
    return fprintf(stderr, "%s\n", drivebench_bridge_error(NULL)), 1;
  }
  target_rpm = 10656.0f; /* 80 % of 900 rpm/V times 14.8 V */
  set_legs();
  for (uint64_t end = MS; end <= RUN_TIME; end += MS) {
    while (now < end) {
      if (go_on(end) != DRIVEBENCH_OK) return fprintf(stderr, "%s\n", drivebench_bridge_error(bridge)), 1;
    }
    if (end == STEP_TIME) {
      before_rpm = rpm();
      drivebench_bridge_set_load(bridge, 0.015);
      drivebench_bridge_mark(bridge);
    }
    if (end > STEP_TIME) lowest_rpm = fmin(lowest_rpm, rpm());
  }
  drivebench_bridge_mean(bridge, &means);
  printf("%.0f rpm before the load step, at least %.0f after it, %.0f at the end\n", before_rpm, lowest_rpm,
         rpm());
  printf("%d commutations, %d without a crossing\n", commutations, lost);
  printf(
      "after the step %.2f A at %.2f V: %.1f W, of which %.1f W turn the propeller and %.2f W heat the "
      "winding\n",
      means.link_a, means.bus_v, means.link_j / means.time_s, means.shaft_j / means.time_s,
      means.copper_j / means.time_s);
  drivebench_bridge_close(bridge);
  return 0;
}
