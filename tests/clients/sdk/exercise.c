/* The same requests over any way to a bench, in C99; prints all that comes back. Arguments: an address; "bus"
 * where only commands can go, "die" to lose the server, "edges" for edges of legs. The bench is servo, with
 * "edges" esc. */
#include <drivebench.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static drivebench_bench* bench;
static uint64_t digest = 14695981039346656037u; /* FNV-1a of all samples */

static void tell(const char* what, int code) {
  printf("%s: %d '%s' field '%s'\n", what, code, drivebench_error(bench), drivebench_error_field(bench));
}

static void count(const drivebench_sample* sample) {
  const unsigned char* bytes = (const unsigned char*)sample;
  size_t i;
  for (i = 0; i < sizeof *sample; ++i)
    digest = (digest ^ bytes[i]) * 1099511628211u;
}

/* Rotating voltages, from tick 500 on duties, from 700 on without the legs of phase b, in numbers that
 * float32 holds exactly, so that a field bus carries them whole. */
static drivebench_command command_at(uint64_t tick) {
  const float phase = 0.05f * (float)tick;
  drivebench_command command;
  memset(&command, 0, sizeof command);
  command.tick = tick;
  command.gates = DRIVEBENCH_GATES_VOLTAGE;
  command.setpoint_a = (double)(20.0f * cosf(phase));
  command.setpoint_b = (double)(20.0f * sinf(phase));
  if (tick >= 500) {
    command.gates = DRIVEBENCH_GATES_DUTY;
    command.setpoint_a = (double)(0.25f * cosf(phase));
    command.setpoint_b = (double)(0.25f * sinf(phase));
  }
  if (tick >= 700) command.legs_off = 2;
  return command;
}

static drivebench_sample run(drivebench_sample sample, uint64_t until) {
  while (sample.tick < until) {
    const drivebench_command command = command_at(sample.tick);
    const int code = drivebench_step(bench, &command, 1, &sample);
    if (code != DRIVEBENCH_OK) {
      tell("step", code);
      break;
    }
    count(&sample);
  }
  printf("tick %" PRIu64 ": encoder %" PRId64 ", state %" PRIu64 ", faults %" PRIu64 "\n", sample.tick,
         sample.encoder_count, sample.state, sample.faults);
  return sample;
}

static void change(void) {
  double value = 0.0;
  tell("load", drivebench_set_load(bench, 0, 0.02, 100, 0));
  tell("load too large", drivebench_set_load(bench, 0, 1e9, 0, 0));
  tell("load not a number", drivebench_set_load(bench, 0, NAN, 0, 0));
  tell("set", drivebench_set(bench, 0, "machine.rotor_resistance_ohm", 5.0, 200, 0));
  tell("set later", drivebench_set(bench, 0, "mechanics.inertia_kgm2", 2e-4, 0, 600));
  tell("set below its minimum", drivebench_set(bench, 0, "machine.rotor_resistance_ohm", -1.0, 0, 0));
  tell("set what is fixed", drivebench_set(bench, 0, "machine.pole_pairs", 3.0, 0, 0));
  tell("set a name that is none", drivebench_set(bench, 0, "machine.rotor_resistence_ohm", 1.0, 0, 0));
  tell("set at no tick", drivebench_set(bench, 0, "machine.rotor_resistance_ohm", 1.0, 0, UINT64_MAX));
  tell("get", drivebench_get(bench, 0, "machine.rotor_resistance_ohm", &value));
  printf("rotor resistance %.17g\n", value);
  tell("get a name that is none", drivebench_get(bench, 0, "nothing", &value));
  tell("inject", drivebench_inject(bench, 0, "stator_resistance_drift", 0.1, 0));
  tell("inject a name that is none", drivebench_inject(bench, 0, "open_fase", 1.0, 0));
  tell("inject a value that is none", drivebench_inject(bench, 0, "open_phase", 1.5, 0));
  tell("bump", drivebench_bump(bench, 0, 1e-5, 450));
  tell("another axis", drivebench_set_load(bench, 7, 0.0, 0, 0));
}

/* The last ticks once more from a saved state, then all from tick 0: what comes back is as the first time. */
static void go_back(uint64_t until) {
  static unsigned char state[65536];
  size_t size = sizeof state;
  uint64_t hash = 0;
  drivebench_sample sample;
  tell("save", drivebench_save(bench, state, &size));
  printf("%u bytes\n", (unsigned)size);
  drivebench_newest(bench, 0, &sample);
  run(sample, until);
  drivebench_state_hash(bench, &hash);
  printf("hash %016" PRIx64 "\n", hash);
  tell("restore", drivebench_restore(bench, state, size));
  drivebench_newest(bench, 0, &sample);
  run(sample, until);
  drivebench_state_hash(bench, &hash);
  printf("hash again %016" PRIx64 "\n", hash);
  tell("restore a part", drivebench_restore(bench, state, size / 2));
  state[100] ^= 1;
  tell("restore what is damaged", drivebench_restore(bench, state, size));
  tell("restore too much", drivebench_restore(bench, state, sizeof state));
  tell("reset", drivebench_reset(bench));
  drivebench_newest(bench, 0, &sample);
  printf("tick %" PRIu64 "\n", sample.tick);
  run(sample, 400);
  drivebench_state_hash(bench, &hash);
  printf("hash %016" PRIx64 "\n", hash);
}

static void describe(void) {
  const drivebench_description* d = drivebench_describe(bench);
  size_t i;
  printf("%s: mode %d, %.9g s, %u substeps, delay %u, arming %u, watchdog %u, lease %.9g s, seed %" PRIu64
         ", %016" PRIx64 "\n",
         d->name, (int)d->mode, d->period_s, (unsigned)d->substeps, (unsigned)d->command_delay_ticks,
         (unsigned)d->arming_commands, (unsigned)d->watchdog_ticks, d->lease_s, d->seed,
         d->configuration_hash);
  for (i = 0; i < d->axis_count; ++i) {
    const drivebench_axis* a = &d->axes[i];
    size_t k;
    printf("axis %s: %s %s %s %s %u %d\n", a->name, a->machine, a->machine_kind, a->connection, a->drive_kind,
           (unsigned)a->phases, (int)a->field_winding);
    for (k = 0; k < a->parameter_count; ++k) {
      const drivebench_parameter* p = &a->parameters[k];
      printf("%s [%s] %.17g..%.17g %.17g %d %d %s\n", p->name, p->unit, p->minimum, p->maximum, p->value,
             (int)p->integer, (int)p->live, p->meaning);
    }
  }
  for (i = 0; i < d->signal_count; ++i) {
    const drivebench_signal* s = &d->signals[i];
    printf("%s [%s] %d %d %.17g..%.17g %d %s\n", s->name, s->unit, (int)s->kind, (int)s->type, s->minimum,
           s->maximum, (int)s->known, s->meaning);
  }
  for (i = 0; i < d->fault_count; ++i)
    printf("%" PRIu64 " %s %d %s\n", d->faults[i].bit, d->faults[i].name, (int)d->faults[i].latched,
           d->faults[i].meaning);
  for (i = 0; i < d->injectable_count; ++i) {
    const drivebench_injectable* f = &d->injectables[i];
    printf("%" PRIu64 " %s [%s] %g..%g %d %s\n", f->bit, f->name, f->unit, f->minimum, f->maximum,
           (int)f->integer, f->meaning);
  }
}

/* Waits for a line before it goes on: the test ends the server meanwhile. */
static int die(void) {
  const drivebench_command command = command_at(0);
  drivebench_acquire(bench, 0);
  printf("ready\n");
  fflush(stdout);
  getchar();
  tell("step", drivebench_step(bench, &command, 1, NULL));
  tell("again", drivebench_acquire(bench, 0));
  drivebench_close(bench);
  return 0;
}

static void refuse_edges(drivebench_command command) {
  drivebench_edge* const a = command.edges[0];
  a[0].offset_ns = 5000, a[0].level = DRIVEBENCH_LEVEL_HIGH;
  a[1].offset_ns = 5000, a[1].level = DRIVEBENCH_LEVEL_LOW;
  tell("two edges at once", drivebench_step(bench, &command, 1, NULL));
  a[1].offset_ns = 20000;
  tell("an edge at the end of the tick", drivebench_step(bench, &command, 1, NULL));
  a[1].offset_ns = 6000, a[1].level = 4;
  tell("a level that is none", drivebench_step(bench, &command, 1, NULL));
  a[1].level = DRIVEBENCH_LEVEL_NONE, a[2].offset_ns = 7000, a[2].level = DRIVEBENCH_LEVEL_OFF;
  tell("an edge behind the end of the list", drivebench_step(bench, &command, 1, NULL));
  a[2].offset_ns = 4000000000u, a[1] = a[2], a[2].level = DRIVEBENCH_LEVEL_NONE;
  tell("an offset beyond all ticks", drivebench_step(bench, &command, 1, NULL));
}

/* Each leg is high for some nanoseconds that turn about, and off at its end: what no duty can say. */
static void run_edges(drivebench_sample sample) {
  uint64_t hash = 0;
  drivebench_command command;
  memset(&command, 0, sizeof command);
  command.gates = DRIVEBENCH_GATES_EDGES;
  command.tick = sample.tick;
  refuse_edges(command);
  while (sample.tick < 2000) {
    unsigned leg;
    for (leg = 0; leg < 3; ++leg) {
      drivebench_edge* const edges = command.edges[leg];
      const unsigned width = (unsigned)((sample.tick / 40 + 4 * leg) % 12) * 90u + 1u;
      edges[0].offset_ns = 0, edges[0].level = DRIVEBENCH_LEVEL_LOW;
      edges[1].offset_ns = 4000 + leg, edges[1].level = DRIVEBENCH_LEVEL_HIGH;
      edges[2].offset_ns = 4000 + leg + width, edges[2].level = DRIVEBENCH_LEVEL_LOW;
      edges[3].offset_ns = 19000 - width,
      edges[3].level = sample.tick % 7 == leg ? DRIVEBENCH_LEVEL_OFF : DRIVEBENCH_LEVEL_NONE;
    }
    command.tick = sample.tick;
    if (drivebench_step(bench, &command, 1, &sample) != DRIVEBENCH_OK) {
      tell("step", -1);
      break;
    }
    count(&sample);
  }
  drivebench_state_hash(bench, &hash);
  printf("tick %" PRIu64 ": faults %" PRIu64 ", %.17g A, %.17g V, %.17g rad\n", sample.tick, sample.faults,
         sample.true_i_a_a, sample.terminal_b_mean_v, sample.angle_rad);
  printf("hash %016" PRIx64 ", digest %016" PRIx64 "\n", hash, digest);
}

int main(int argc, char** argv) {
  const int is_bus = argc > 2 && strcmp(argv[2], "bus") == 0;
  drivebench_options options;
  drivebench_sample sample;
  drivebench_command wrong = command_at(0);
  uint64_t hash = 0;
  memset(&options, 0, sizeof options);
  options.client = "exercise";
  if (drivebench_open(argc > 1 ? argv[1] : "inproc:servo", &options, &bench) != DRIVEBENCH_OK) {
    printf("open: %s\n", drivebench_error(NULL));
    return 1;
  }
  if (argc > 2 && strcmp(argv[2], "die") == 0) return die();
  if (!is_bus) {
    describe();
    tell("step without the lease", drivebench_step(bench, &wrong, 1, NULL));
    tell("load without the lease", drivebench_set_load(bench, 0, 0.1, 0, 0));
  }
  tell("acquire", drivebench_acquire(bench, 0));
  tell("acquire another axis", drivebench_acquire(bench, 3));
  tell("newest", drivebench_newest(bench, 0, &sample));
  if (argc > 2 && strcmp(argv[2], "edges") == 0) {
    run_edges(sample);
    drivebench_close(bench);
    return 0;
  }
  sample = run(sample, 400);
  if (!is_bus) {
    change();
    tell("the same tick again", drivebench_step(bench, &wrong, 1, NULL));
    wrong.tick = 400;
    wrong.gates = 9;
    tell("gates that are none", drivebench_step(bench, &wrong, 1, NULL));
    wrong.gates = DRIVEBENCH_GATES_DUTY;
    wrong.legs_off = 9;
    tell("a leg that is none", drivebench_step(bench, &wrong, 1, NULL));
    wrong.legs_off = 0;
    wrong.gates = DRIVEBENCH_GATES_CURRENT;
    tell("currents for a voltage drive", drivebench_step(bench, &wrong, 1, NULL));
    wrong.gates = DRIVEBENCH_GATES_EDGES;
    tell("edges for an amplifier", drivebench_step(bench, &wrong, 1, NULL));
    wrong.gates = DRIVEBENCH_GATES_VOLTAGE;
    wrong.setpoint_b = INFINITY;
    tell("an infinite voltage", drivebench_step(bench, &wrong, 1, NULL));
    tell("clear without a fault", drivebench_clear(bench, 0));
  }
  sample = run(sample, 900);
  if (!is_bus) {
    tell("hash", drivebench_state_hash(bench, &hash));
    go_back(1000);
    printf("hash %016" PRIx64 ", digest %016" PRIx64 "\n", hash, digest);
  }
  tell("release", drivebench_release(bench, 0));
  drivebench_close(bench);
  return 0;
}
