/* Field-oriented control of a PM servo in C, cut as a firmware is: a board support file, the firmware itself,
 * and the timer that calls its interrupt. Only the board support knows the bench; on a real board it writes
 * compare registers and reads converters. Argument: the address of a bench (bm500). */
#include <drivebench.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

/* ---- board support: timer, converters, encoder ---- */

#define PWM_PERIOD 8500            /* counts of a centre-aligned timer of 170 MHz at 10 kHz */
#define ADC_AMPERE_PER_COUNT 0.04f /* shunt and amplifier: 12 bits, zero at 2048, +-82 A */
#define ENCODER_COUNTS 8192

static drivebench_bench* bench;
static drivebench_sample sensors;
static drivebench_command command;

/* Compare counts of the three legs: 0 low, PWM_PERIOD high. */
static void pwm_set(int a, int b, int c) {
  command.gates = DRIVEBENCH_GATES_DUTY;
  command.setpoint_a = (double)a / PWM_PERIOD;
  command.setpoint_b = (double)b / PWM_PERIOD;
  command.setpoint_c = (double)c / PWM_PERIOD;
}

static int adc_read(double current_a) {
  return (int)lround(current_a / (double)ADC_AMPERE_PER_COUNT) + 2048;
}
static int adc_phase_a(void) {
  return adc_read(sensors.i_a_a);
}
static int adc_phase_b(void) {
  return adc_read(sensors.i_b_a);
}
static float adc_bus_volts(void) {
  return (float)sensors.bus_voltage_v;
}
static uint16_t encoder_read(void) {
  return (uint16_t)sensors.encoder_count;
} /* a timer of 16 bits: it wraps */

/* ---- the firmware: single precision, amplitude-invariant as most firmware, nothing of the bench ---- */

#define PERIOD_S 1e-4f
#define POLE_PAIRS 4
#define RESISTANCE_OHM 0.25f
#define INDUCTANCE_H 1.4e-3f
#define FLUX_WB 0.03307f /* peak of a phase: K_m / (sqrt(3/2) p) = 0.162 / (1.2247 * 4) */
#define TORQUE_NM_PER_A (1.5f * POLE_PAIRS * FLUX_WB)
#define INERTIA_KGM2 1.39e-4f
#define CURRENT_RAD_S 2000.0f /* corner of the current loop */
#define SPEED_RAD_S 100.0f    /* corner of the speed loop */

typedef struct {
  float integral, limit;
} Pi;

static float pi_step(Pi* pi, float error, float proportional, float integral_per_s) {
  const float out = pi->integral + proportional * error;
  const float limited = fminf(fmaxf(out, -pi->limit), pi->limit);
  if (out == limited) pi->integral += integral_per_s * PERIOD_S * error; /* no wind-up */
  return limited;
}

static Pi d_loop, q_loop, speed_loop = {0.0f, 30.0f};
static float speed_reference_rad_s, speed_rad_s, i_q_a;
static uint16_t count_before;

static void control_interrupt(void) {
  const uint16_t count = encoder_read();
  const float turned = (float)(int16_t)(count - count_before) * (6.2831853f / ENCODER_COUNTS);
  const float theta = (float)(count % ENCODER_COUNTS) * (6.2831853f / ENCODER_COUNTS) * POLE_PAIRS;
  const float cosine = cosf(theta), sine = sinf(theta);
  const float i_a = (float)(adc_phase_a() - 2048) * ADC_AMPERE_PER_COUNT;
  const float i_b = (float)(adc_phase_b() - 2048) * ADC_AMPERE_PER_COUNT;
  const float i_beta = (i_a + 2.0f * i_b) * 0.57735027f;
  const float i_d = cosine * i_a + sine * i_beta, half = 0.5f * adc_bus_volts();
  float ahead, u_d, u_q, u_alpha, u_beta, omega;
  count_before = count;
  speed_rad_s += 0.05f * (turned / PERIOD_S - speed_rad_s);
  i_q_a = -sine * i_a + cosine * i_beta;
  omega = POLE_PAIRS * speed_rad_s;

  d_loop.limit = q_loop.limit = 0.55f * half;
  {
    const float wanted = pi_step(&speed_loop, speed_reference_rad_s - speed_rad_s,
                                 INERTIA_KGM2 * SPEED_RAD_S / TORQUE_NM_PER_A,
                                 0.25f * INERTIA_KGM2 * SPEED_RAD_S * SPEED_RAD_S / TORQUE_NM_PER_A);
    u_d = pi_step(&d_loop, -i_d, INDUCTANCE_H * CURRENT_RAD_S, RESISTANCE_OHM * CURRENT_RAD_S) -
          omega * INDUCTANCE_H * i_q_a;
    u_q = pi_step(&q_loop, wanted - i_q_a, INDUCTANCE_H * CURRENT_RAD_S, RESISTANCE_OHM * CURRENT_RAD_S) +
          omega * (INDUCTANCE_H * i_d + FLUX_WB);
  }
  ahead = theta + 1.5f * omega * PERIOD_S; /* the compare counts act in the next period, in its middle */
  u_alpha = cosf(ahead) * u_d - sinf(ahead) * u_q;
  u_beta = sinf(ahead) * u_d + cosf(ahead) * u_q;
  {
    const float counts_per_volt = PWM_PERIOD / (2.0f * half), middle = PWM_PERIOD / 2;
    pwm_set((int)(middle + counts_per_volt * u_alpha),
            (int)(middle + counts_per_volt * (-0.5f * u_alpha + 0.8660254f * u_beta)),
            (int)(middle + counts_per_volt * (-0.5f * u_alpha - 0.8660254f * u_beta)));
  }
}

/* ---- the bench: the timer that calls the interrupt, and the load ---- */

int main(int argc, char** argv) {
  double sum_a = 0.0;
  if (drivebench_open(argc > 1 ? argv[1] : "inproc:bm500", NULL, &bench) != DRIVEBENCH_OK) {
    return fprintf(stderr, "%s\n", drivebench_error(NULL)), 1;
  }
  drivebench_acquire(bench, 0);
  drivebench_newest(bench, 0, &sensors);
  while (sensors.tick < 10000) { /* a second */
    speed_reference_rad_s = fminf(100.0f, 500.0f * (float)sensors.tick * PERIOD_S);
    if (sensors.tick == 5000) drivebench_set_load(bench, 0, 0.5, 0, 0);
    control_interrupt();
    if (sensors.tick >= 9000) sum_a += (double)i_q_a; /* converter counts and ripple average out */
    command.tick = sensors.tick;
    if (drivebench_step(bench, &command, 1, &sensors) != DRIVEBENCH_OK) {
      return fprintf(stderr, "%s\n", drivebench_error(bench)), 1;
    }
  }
  printf("%.1f rad/s, q current %.3f A for 0.5 N m: %.4f N m/A of %.4f\n", sensors.speed_rad_s, sum_a / 1000,
         500.0 / sum_a, (double)TORQUE_NM_PER_A);
  drivebench_close(bench);
  return 0;
}
