/**
 * drivebench.h: the bench from C, and from every language that can call C.
 *
 * One small set of calls, the same over every way to a bench:
 *
 *   inproc:BENCH                 the bench in this process: a bench file, or the name of a shipped one
 *   tcp:HOST:PORT, HOST:PORT     a drivebench-server (`drivebench serve`), port 7300 unless named
 *   tls:HOST:PORT?ca=FILE&certificate=FILE&key=FILE
 *   unix:PATH                    the same on this machine
 *   shm:PATH                     its unix socket, and exchanges through memory that both share
 *   can:BACKEND:CHANNEL?node=N   one axis over the native CAN profile
 *   modbus:HOST:PORT?unit=N      one axis over Modbus TCP
 *
 * With ?spin_us=N behind a tcp:, unix: or shm: address the program looks so long for an answer before it
 * sleeps.
 *
 * Over inproc, tcp, tls, unix and shm the same calls give the same samples, bit for bit. CAN FD and Modbus
 * carry float32, classic CAN scaled integers: they round.
 *
 * Time counts in ticks. In lockstep, and always in process, drivebench_step() runs the tick whose commands it
 * brings, and nothing else moves time. In real time it returns with the next tick.
 *
 * SI units; motor convention (power into the machine is positive); rotation positive from phase a to phase b;
 * two-phase quantities are power-invariant (a three-phase amplitude times sqrt(3/2)).
 *
 * Every call that can fail returns 0 (DRIVEBENCH_OK) or a code; drivebench_error() has the sentence. A bench
 * belongs to one thread at a time; several benches may be open. drivebench_step() and drivebench_newest()
 * allocate nothing, and in process make no system call.
 */
#ifndef DRIVEBENCH_H
#define DRIVEBENCH_H

#include <stddef.h>
#include <stdint.h>

#if defined(DRIVEBENCH_BUILDS_LIBRARY)
#define DRIVEBENCH_API __attribute__((visibility("default")))
#else
#define DRIVEBENCH_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** Grows when a call or a struct other than drivebench_sample changes; the library refuses a header of
 * another. */
#define DRIVEBENCH_ABI 1

/** The result of a call. The positive codes are refusals of the bench: the numbers of RefusalCode in
 * bench.proto. */
enum drivebench_code {
  DRIVEBENCH_OK = 0,
  DRIVEBENCH_MALFORMED = 1,
  DRIVEBENCH_VERSION = 2,         /**< the server speaks another version of the protocol */
  DRIVEBENCH_UNAUTHENTICATED = 3, /**< the token is missing or wrong */
  DRIVEBENCH_UNKNOWN_AXIS = 4,
  DRIVEBENCH_UNKNOWN_SIGNAL = 5,
  DRIVEBENCH_UNKNOWN_PARAMETER = 6,
  DRIVEBENCH_OUT_OF_RANGE = 7,
  DRIVEBENCH_NOT_FINITE = 8,
  DRIVEBENCH_NOT_OWNER = 9, /**< acquire the axis first */
  DRIVEBENCH_OWNED = 10,    /**< another controller holds the axis */
  DRIVEBENCH_LATCHED = 11,  /**< a latched fault is in force: drivebench_clear() */
  DRIVEBENCH_STALE =
      12, /**< the command answers a sample that is too old, answered already or not taken yet */
  DRIVEBENCH_BUSY = 13,
  DRIVEBENCH_READ_ONLY = 14,
  DRIVEBENCH_WRONG_MODE = 15,
  DRIVEBENCH_WRONG_DRIVE = 16,
  DRIVEBENCH_UNKNOWN_FAULT = 17,
  DRIVEBENCH_NOT_AVAILABLE = 20, /**< this way to the bench does not carry the request */
  DRIVEBENCH_CAUSE_LASTS = 21,   /**< what caused the latched fault is still there */
  DRIVEBENCH_FORBIDDEN = 22,     /**< the role of the token does not allow the request */
  DRIVEBENCH_SHARED_AMPLIFIER =
      23, /**< commands and lease are those of the axis whose amplifier this one shares */

  DRIVEBENCH_BAD_ARGUMENT = -1, /**< an argument is wrong; the bench was not asked */
  DRIVEBENCH_NO_BENCH = -2,     /**< nothing answers at the address, or the bench file is unusable */
  DRIVEBENCH_LINK_LOST = -3,    /**< the link failed and is closed; only drivebench_close() is left */
  DRIVEBENCH_OTHER_ABI = -4,    /**< the program was built with the header of another version */
  DRIVEBENCH_FAILED = -5        /**< the system refused something, such as memory */
};

/** The state of the gates for one tick. */
enum drivebench_gates {
  DRIVEBENCH_GATES_OFF = 0, /**< freewheel: currents flow through the diodes until they are zero */
  DRIVEBENCH_GATES_VOLTAGE =
      1,                     /**< set-points are voltages [V]; in a star against the middle of the DC link */
  DRIVEBENCH_GATES_ZERO = 2, /**< active short circuit */
  DRIVEBENCH_GATES_CURRENT = 3, /**< set-points are currents [A]; only a drive of kind "current_amplifier" */
  /** Set-points are duties: of a leg of a star its mean voltage against the negative rail over the link's, 0
   * to 1; of a winding between two legs, and of the field, its voltage over the link's, -1 to 1. */
  DRIVEBENCH_GATES_DUTY = 4,
  DRIVEBENCH_GATES_EDGES = 5 /**< the legs switch at their edges; only a drive of kind "switched_inverter" */
};

/** The level of a leg. */
enum drivebench_level {
  DRIVEBENCH_LEVEL_NONE = 0, /**< no edge: the list ends */
  DRIVEBENCH_LEVEL_OFF = 1,  /**< both switches open: the current flows on through a diode */
  DRIVEBENCH_LEVEL_LOW = 2,  /**< at the negative rail */
  DRIVEBENCH_LEVEL_HIGH = 3  /**< at the positive rail */
};

/** From this instant of the tick on a leg has this level. */
typedef struct drivebench_edge {
  uint32_t offset_ns;
  uint32_t level; /**< a drivebench_level */
} drivebench_edge;

#define DRIVEBENCH_MAX_EDGES 8

enum drivebench_mode { DRIVEBENCH_MODE_REALTIME = 1, DRIVEBENCH_MODE_LOCKSTEP = 2, DRIVEBENCH_MODE_FREE = 3 };

/** An open bench. */
typedef struct drivebench_bench drivebench_bench;

/** What a controller asks of an axis, in answer to the sample of `tick`. A machine ignores terminals that it
 * lacks. */
typedef struct drivebench_command {
  uint32_t axis;
  uint32_t gates;    /**< a drivebench_gates */
  uint64_t tick;     /**< of the sample that this command answers; above that of the command before */
  double setpoint_a; /**< phase a, or an armature: [V], [A] or a duty, as the gates say */
  double setpoint_b;
  double setpoint_c;
  double setpoint_f; /**< field winding */
  uint64_t
      legs_off; /**< legs that are off, on their diodes, whatever the gates of the others do: 1 a, 2 b, 4 c */
  /** With DRIVEBENCH_GATES_EDGES, of legs a, b, c: offsets rise and are below the period. Until its first
   * edge a leg keeps the level that its list of the tick before ended with; after other gates it is off, and
   * so is a leg without edges. A switch closes inverter.dead_time_s after the other one of its leg has
   * opened. */
  drivebench_edge edges[3][DRIVEBENCH_MAX_EDGES];
} drivebench_command;

/**
 * The signals of an axis at the start of a tick: sensors, state, and what only an emulated bench knows
 * (speed_rad_s, true_i_a_a, ...). A link that does not carry a signal leaves it as before tick 0: see
 * drivebench_signal.known. New signals come last, so that programs built with an older header go on.
 */
typedef struct drivebench_sample {
  uint64_t tick;              /**< sample period; the sample is taken at its start */
  int64_t command_tick;       /**< tick of the sample that the command in force answered; -1: none */
  uint64_t command_age_ticks; /**< [ticks] ticks since the tick that the command in force answered */
  uint64_t missed_commands;   /**< ticks for which a controller owed a command and sent none */
  uint64_t refused_commands;  /**< refused commands of the controller, and scheduled inputs that could not be
                                 carried out */
  uint64_t late_ticks;        /**< ticks of the bench that started after their time */
  uint64_t state;             /**< 0 idle, 1 run, 2 hold, 3 timeout, 4 fault, 5 ready */
  uint64_t faults;            /**< fault word; the description lists the bits */
  uint64_t owner;             /**< number of the controller that holds the lease; 0: none */
  int64_t encoder_count;      /**< [counts] floor(theta N/(2 pi)), plus the offset */
  uint64_t
      encoder_levels;   /**< 1 A, 2 B, 4 Z, 8 last edge counted down, 16 direction changed, 32 period valid */
  double edge_age_s;    /**< [s] time since the last edge; since tick 0 if none */
  double edge_period_s; /**< [s] time between the last two edges; 0 until there were two */
  int64_t index_count;  /**< [counts] count latched when Z last rose */
  int64_t index_tick;   /**< tick in which Z last rose; -1: never */
  double i_a_a;         /**< [A] measured current of phase a, into the machine */
  double i_b_a;         /**< [A] measured current of phase b, into the machine */
  double u_a_v;         /**< [V] voltage at phase a at the end of the tick before */
  double u_b_v;         /**< [V] voltage at phase b at the end of the tick before */
  double angle_rad;     /**< [rad] true shaft angle since the start */
  double speed_rad_s;   /**< [rad/s] true speed, positive from a to b */
  double torque_nm;     /**< [N*m] torque of the machine on the shaft */
  double load_nm;       /**< [N*m] load torque; positive opposes positive torque */
  double true_i_a_a;    /**< [A] true current of phase a */
  double true_i_b_a;    /**< [A] true current of phase b */
  double psi_a_wb;      /**< [Wb] rotor flux linkage, stator axis a */
  double psi_b_wb;      /**< [Wb] rotor flux linkage, stator axis b */
  double bus_voltage_v; /**< [V] voltage of the DC link */
  double i_c_a;         /**< [A] measured current of phase c, into the machine */
  double i_f_a;         /**< [A] measured current of the field winding */
  double u_c_v;         /**< [V] voltage at phase c at the end of the tick before */
  double u_f_v;         /**< [V] voltage at the field winding */
  double u_n_v;         /**< [V] neutral of the motor against the middle of the DC link */
  uint64_t hall_lines;  /**< Hall lines: 1 line 1, 2 line 2, 4 line 3 */
  double tachometer_v;  /**< [V] voltage of the tachometer */
  double resolver_sin_v;       /**< [V] sine winding of the resolver, demodulated */
  double resolver_cos_v;       /**< [V] cosine winding of the resolver, demodulated */
  double temperature_k;        /**< [K] temperature of the windings */
  double meter_u_rms_v;        /**< [V] power analyser, last whole window: rms voltage */
  double meter_i_rms_a;        /**< [A] power analyser: rms current */
  double meter_p_w;            /**< [W] power analyser: active power */
  double meter_q_var;          /**< [var] power analyser: reactive power */
  double meter_pf;             /**< power analyser: power factor */
  double true_i_c_a;           /**< [A] true current of phase c */
  double true_i_f_a;           /**< [A] true current of the field winding */
  double load_angle_rad;       /**< [rad] true angle of the output: behind gear and elastic shaft */
  double load_speed_rad_s;     /**< [rad/s] true speed of the output */
  double load_position_m;      /**< [m] true position of the table on the screw */
  uint64_t injected;           /**< injected faults in force; the description lists the bits */
  double terminal_a_v;         /**< [V] terminal a against the negative rail at the end of the tick before */
  double terminal_b_v;         /**< [V] terminal b against the negative rail at the end of the tick before */
  double terminal_c_v;         /**< [V] terminal c against the negative rail at the end of the tick before */
  double terminal_a_mean_v;    /**< [V] terminal a against the negative rail, mean over the tick before */
  double terminal_b_mean_v;    /**< [V] terminal b against the negative rail, mean over the tick before */
  double terminal_c_mean_v;    /**< [V] terminal c against the negative rail, mean over the tick before */
  uint64_t comparator_levels;  /**< comparators of the terminals: 1 a, 2 b, 4 c above the reference */
  uint64_t comparator_a_edges; /**< edges of the comparator of a since tick 0 */
  uint64_t comparator_b_edges; /**< edges of the comparator of b since tick 0 */
  uint64_t comparator_c_edges; /**< edges of the comparator of c since tick 0 */
  double comparator_a_age_s; /**< [s] time since the last edge of the comparator of a; since tick 0 if none */
  double comparator_b_age_s; /**< [s] time since the last edge of the comparator of b; since tick 0 if none */
  double comparator_c_age_s; /**< [s] time since the last edge of the comparator of c; since tick 0 if none */
  double comparator_a_v;     /**< [V] terminal a less the reference of its comparator, behind the RC */
  double comparator_b_v;     /**< [V] terminal b less the reference of its comparator, behind the RC */
  double comparator_c_v;     /**< [V] terminal c less the reference of its comparator, behind the RC */
  uint64_t i_a_counts;       /**< [counts] converter of the current of phase a */
  uint64_t i_b_counts;       /**< [counts] converter of the current of phase b */
  uint64_t i_c_counts;       /**< [counts] converter of the current of phase c */
  uint64_t u_a_counts;       /**< [counts] converter of the voltage at phase a */
  uint64_t u_b_counts;       /**< [counts] converter of the voltage at phase b */
  uint64_t u_c_counts;       /**< [counts] converter of the voltage at phase c */
  uint64_t bus_counts;       /**< [counts] converter of the voltage of the DC link */
  uint64_t temperature_counts; /**< [counts] converter of the temperature */
  uint64_t encoder_timer;      /**< [counts] quadrature timer: the count, which wraps */
  uint64_t
      encoder_capture; /**< [clocks] clocks of the capture timer between the last two edges of the encoder */
  uint64_t absolute_angle; /**< [counts] absolute encoder: angle within the turn, of 2^bits steps */
  uint64_t hall_edges;     /**< edges of the Hall lines since tick 0 */
  double hall_edge_age_s;  /**< [s] time since the last edge of the Hall lines; since tick 0 if none */
  uint64_t hall_capture;   /**< [clocks] timer when the last edge of the Hall lines came; it wraps */
} drivebench_sample;

enum drivebench_kind { DRIVEBENCH_KIND_STATUS = 1, DRIVEBENCH_KIND_SENSOR = 2, DRIVEBENCH_KIND_TRUTH = 3 };
enum drivebench_type { DRIVEBENCH_TYPE_UNSIGNED = 0, DRIVEBENCH_TYPE_SIGNED = 1, DRIVEBENCH_TYPE_REAL = 2 };

/** A member of drivebench_sample: they stand in the order of the signals, 8 bytes each. */
typedef struct drivebench_signal {
  const char* name;
  const char* unit;
  const char* meaning;
  int32_t kind;   /**< a drivebench_kind; a controller on a real bench has no truth */
  int32_t type;   /**< a drivebench_type */
  double minimum; /**< of the usual range */
  double maximum;
  int32_t known; /**< 1: this link carries the signal */
} drivebench_signal;

typedef struct drivebench_parameter {
  const char* name; /**< for example "machine.rotor_resistance_ohm" */
  const char* unit;
  const char* meaning;
  double minimum;
  double maximum;
  double value;    /**< when the bench was opened; drivebench_get() reads the value in force */
  int32_t integer; /**< 1: whole numbers only */
  int32_t live;    /**< 1: drivebench_set() may write it */
} drivebench_parameter;

typedef struct drivebench_axis {
  const char* name;
  const char* machine;      /**< name of the motor */
  const char* machine_kind; /**< for example "induction" */
  const char* connection;   /**< "two_phase", "star", "independent" or "armature" */
  const char* drive_kind;   /**< for example "voltage_amplifier" */
  uint32_t phases;          /**< number of the terminals a, b, c */
  int32_t field_winding;    /**< 1: the field has terminals of its own */
  size_t parameter_count;
  const drivebench_parameter* parameters;
  const char* shares_amplifier_with; /**< the axis whose amplifier drives this machine, too; "": none */
} drivebench_axis;

/** A bit of drivebench_sample.faults. */
typedef struct drivebench_fault {
  uint64_t bit;
  const char* name;
  const char* meaning;
  int32_t latched; /**< 1: stays until drivebench_clear() */
} drivebench_fault;

/** A fault that drivebench_inject() can put into an axis; its bit stands in drivebench_sample.injected. */
typedef struct drivebench_injectable {
  uint64_t bit;
  const char* name;
  const char* unit;
  const char* meaning;
  double minimum;
  double maximum;
  int32_t integer;
} drivebench_injectable;

/** A change that the bench file makes at a tick or on a condition: a load, a parameter, a fault, a bump. */
typedef struct drivebench_event {
  uint32_t axis;
  const char* text; /**< for example "fault open_phase = 2 when speed_rad_s > 100 for 40 ticks" */
} drivebench_event;

typedef struct drivebench_description {
  const char* name;
  int32_t mode; /**< a drivebench_mode */
  double period_s;
  uint32_t substeps;
  uint32_t command_delay_ticks; /**< 0: a command holds from the tick that it answers, 1: from the next one */
  uint32_t arming_commands;     /**< accepted commands in a row that arm an axis */
  uint32_t watchdog_ticks;      /**< ticks without a command until the safe action */
  double lease_s;
  uint64_t seed;
  uint64_t configuration_hash;
  size_t axis_count;
  const drivebench_axis* axes;
  size_t signal_count;
  const drivebench_signal* signals;
  size_t fault_count;
  const drivebench_fault* faults;
  size_t injectable_count;
  const drivebench_injectable* injectables;
  size_t event_count; /**< 0 over a link: only a bench in process tells its events */
  const drivebench_event* events;
} drivebench_description;

/** Settings of drivebench_open(); all zero is the default. */
typedef struct drivebench_options {
  const char* token;    /**< of the bench; null: the environment variable DRIVEBENCH_TOKEN, if it is set */
  const char* client;   /**< a name for the server's log; null: "libdrivebench" */
  uint32_t deadline_ms; /**< for connecting and for each answer; 0: 5000 */
  int32_t clear_on_acquire; /**< 1: drivebench_acquire() clears what a controller before has left latched */
  /** 1: drivebench_set(), _set_load(), _inject() and _bump() also change axes that other sessions hold; over
   * tcp, tls and unix, with the role conductor */
  int32_t conducts;
} drivebench_options;

DRIVEBENCH_API int drivebench_open_abi(const char* address, const drivebench_options* options, uint32_t abi,
                                       size_t sample_size, drivebench_bench** bench);

/** Opens a bench; `options` may be null. After a failure *bench is null and drivebench_error(NULL) says why.
 */
static inline int drivebench_open(const char* address, const drivebench_options* options,
                                  drivebench_bench** bench) {
  return drivebench_open_abi(address, options, DRIVEBENCH_ABI, sizeof(drivebench_sample), bench);
}

/** Releases the axes and closes the bench; null is allowed. */
DRIVEBENCH_API void drivebench_close(drivebench_bench* bench);

/** Why the last call on this bench failed, in a sentence; "" if it did not. Null: of this thread's last open.
 */
DRIVEBENCH_API const char* drivebench_error(const drivebench_bench* bench);
/** The field that the refusal names, for example "axis"; "" if none. */
DRIVEBENCH_API const char* drivebench_error_field(const drivebench_bench* bench);

/** The bench, its axes, signals and faults; valid until drivebench_close(). A field bus leaves out what it
 * cannot ask. */
DRIVEBENCH_API const drivebench_description* drivebench_describe(const drivebench_bench* bench);

/** Acquires the lease of an axis: only its holder may command, change and clear. */
DRIVEBENCH_API int drivebench_acquire(drivebench_bench* bench, uint32_t axis);
/** Keeps a lease without a command. */
DRIVEBENCH_API int drivebench_renew(drivebench_bench* bench, uint32_t axis);
DRIVEBENCH_API int drivebench_release(drivebench_bench* bench, uint32_t axis);
/** Clears the latched faults of an axis. */
DRIVEBENCH_API int drivebench_clear(drivebench_bench* bench, uint32_t axis);

/**
 * Gives the bench a command for each of `count` axes and waits for the next sample of each, in the order of
 * the commands. If one command is refused, none is taken. In lockstep a tick runs when every axis that a
 * controller holds has its command. `samples` may be null.
 */
DRIVEBENCH_API int drivebench_step(drivebench_bench* bench, const drivebench_command* commands, size_t count,
                                   drivebench_sample* samples);
/** The newest sample of an axis, without waiting. */
DRIVEBENCH_API int drivebench_newest(drivebench_bench* bench, uint32_t axis, drivebench_sample* sample);

/** Reads a parameter. */
DRIVEBENCH_API int drivebench_get(drivebench_bench* bench, uint32_t axis, const char* name, double* value);
/** Writes a parameter: at once (at_tick 0) or at a tick, as a step (ramp_ticks 0) or a ramp. */
DRIVEBENCH_API int drivebench_set(drivebench_bench* bench, uint32_t axis, const char* name, double value,
                                  uint64_t ramp_ticks, uint64_t at_tick);
/** Changes the load torque [N*m]; positive opposes a positive torque of the machine. */
DRIVEBENCH_API int drivebench_set_load(drivebench_bench* bench, uint32_t axis, double load_nm,
                                       uint64_t ramp_ticks, uint64_t at_tick);
/** Puts a fault of the description into an axis; a value of 0 takes it away. */
DRIVEBENCH_API int drivebench_inject(drivebench_bench* bench, uint32_t axis, const char* name, double value,
                                     uint64_t at_tick);
/** Bumps the shaft with an angular impulse [N*m*s], positive like a torque of the machine. */
DRIVEBENCH_API int drivebench_bump(drivebench_bench* bench, uint32_t axis, double impulse_nms,
                                   uint64_t at_tick);

/** The tick in which an event of the description acted; -1: not yet. In process only. */
DRIVEBENCH_API int drivebench_event_tick(drivebench_bench* bench, size_t event, int64_t* tick);

/** The hash of the state and of all samples so far: equal hashes mean equal runs. Lockstep only. */
DRIVEBENCH_API int drivebench_state_hash(drivebench_bench* bench, uint64_t* hash);

/**
 * Back to tick 0, without any changes. Leases stay with their holders. In process and over tcp, tls and unix;
 * a server refuses while another session holds an axis (DRIVEBENCH_OWNED) and while it records
 * (DRIVEBENCH_NOT_AVAILABLE). The same holds for drivebench_restore().
 */
DRIVEBENCH_API int drivebench_reset(drivebench_bench* bench);
/**
 * Saves the whole state: machines, sensors, noise, commands, scheduled changes. `*size` is the room in
 * `state` before and the length of the state after; with a null `state` only the length is told.
 */
DRIVEBENCH_API int drivebench_save(drivebench_bench* bench, void* state, size_t* size);
/**
 * Goes on from a saved state of the same bench, in this process, another one or a server. Leases stay with
 * their holders: acquire an axis that the state drives before you restore it, or it has lost its controller.
 */
DRIVEBENCH_API int drivebench_restore(drivebench_bench* bench, const void* state, size_t size);

/** The version of the library, for example "0.1.0". */
DRIVEBENCH_API const char* drivebench_version(void);

#ifdef __cplusplus
}
#endif

#endif
