/**
 * drivebench_bridge.h: the power stage of a bench at gate level, in the process of the caller or in a server
 * on the same machine.
 *
 * For host builds of firmware that have a scheduler of their own, such as those of speed controllers. The
 * program sets its legs whenever it likes, their timers play PWM and dead time, and time goes on to any
 * picosecond that the program asks for. Edges of comparators, Hall lines and currents that die come back with
 * their times. Nothing depends on how the program divides its run: drivebench_bridge_run() to 1 ms in one
 * call or in a million gives the same edges and the same bits.
 *
 * Motor, mechanics, supply, comparators and Hall lines are those of an axis of a bench file with a drive of
 * kind "switched_inverter". Its PWM, command delay, watchdog, lease and scheduled events are not in force:
 * here the caller is the board.
 *
 * "inproc:BENCH" has the plant in this process. "shm:PATH", optionally with "?spin_us=N" behind it as in
 * drivebench.h, is the unix socket of a server in lockstep or free mode: the server makes a copy of the axis
 * for this program alone, from tick 0 on, and carries the calls out in a thread of its own; four programs at
 * most. The results are the same to the bit. A token that the server asks for comes from the environment,
 * DRIVEBENCH_TOKEN.
 *
 * SI units and signs as in drivebench.h, times in picoseconds since the bridge was opened. Every call that
 * can fail returns 0 (DRIVEBENCH_OK) or a code; drivebench_bridge_error() has the sentence, and after a
 * refusal nothing has changed, but that time goes on where _run() says DRIVEBENCH_LATCHED of a machine that
 * has diverged. A bridge belongs to one thread at a time. drivebench_bridge_set(), _run(), _next_edge() and
 * _read() allocate nothing; in process they make no system call, and with shared memory none
 * while both sides are awake.
 */
#ifndef DRIVEBENCH_BRIDGE_H
#define DRIVEBENCH_BRIDGE_H

#include "drivebench.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct drivebench_bridge drivebench_bridge;

enum drivebench_leg_mode {
  DRIVEBENCH_LEG_OPEN = 0,     /**< both switches open: a current goes on through a diode until it is zero */
  DRIVEBENCH_LEG_LOW = 1,      /**< at the negative rail */
  DRIVEBENCH_LEG_HIGH = 2,     /**< at the positive rail */
  DRIVEBENCH_LEG_PWM = 3,      /**< complementary: high for compare_ps of a period, low else */
  DRIVEBENCH_LEG_PWM_HIGH = 4, /**< PWM of the upper switch alone: high for compare_ps, open else */
  DRIVEBENCH_LEG_PWM_LOW = 5   /**< PWM of the lower switch alone: low for compare_ps, open else */
};

/** The timer of a leg. With the modes of PWM the periods reach in both directions from period_start_ps. */
typedef struct drivebench_leg {
  uint32_t mode;    /**< a drivebench_leg_mode */
  uint32_t centred; /**< 1: on in the middle of the period; 0: from its start on */
  uint64_t period_start_ps;
  uint64_t period_ps;  /**< 100 ns to 1 s */
  uint64_t compare_ps; /**< 0 to period_ps */
  uint64_t dead_ps;    /**< a switch closes so long after the other one has opened; at most 1 ms */
} drivebench_leg;

enum drivebench_edge_kind {
  DRIVEBENCH_EDGE_COMPARATOR = 1,   /**< of terminal `channel` */
  DRIVEBENCH_EDGE_HALL = 2,         /**< Hall line `channel` + 1 */
  DRIVEBENCH_EDGE_CURRENT_ZERO = 3, /**< the current of terminal `channel` has died in a diode */
  DRIVEBENCH_EDGE_BREAK = 4 /**< the break input has opened all legs, until drivebench_bridge_clear() */
};

typedef struct drivebench_bridge_edge {
  uint64_t at_ps;
  uint32_t kind;    /**< a drivebench_edge_kind */
  uint32_t channel; /**< 0 terminal a or line 1, 1, 2 */
  uint32_t level;   /**< after it: 0 or 1 */
  uint32_t reserved;
} drivebench_bridge_edge;

/** At one instant. New members come last. */
typedef struct drivebench_bridge_state {
  uint64_t now_ps;
  double current_a[3];  /**< [A] into terminals a, b, c */
  double terminal_v[3]; /**< [V] against the negative rail, before what is set now acts */
  double bus_v;         /**< [V] */
  double angle_rad;     /**< [rad] of the rotor since the start */
  double speed_rad_s;
  double torque_nm;           /**< [N*m] of the machine */
  double load_nm;             /**< [N*m] positive opposes positive torque */
  double magnetic_j;          /**< [J] in the field of the machine */
  double comparator_v[3];     /**< [V] terminal less reference, behind the RC */
  uint64_t comparator_levels; /**< 1 a, 2 b, 4 c: above the reference */
  uint64_t hall_lines;        /**< 1 line 1, 2 line 2, 4 line 3 */
  int64_t encoder_count;
  uint64_t legs;       /**< what the timers ask for, two bits for each leg, a the lowest: 0 open, 1 low,
                          2 high; dead time is open. A break, a trip or a fault opens legs behind it. */
  uint64_t faults;     /**< fault word, as in drivebench_sample */
  uint64_t lost_edges; /**< edges of one step that were more than 512 */
} drivebench_bridge_state;

/**
 * Since drivebench_bridge_mark(), or since the start: time, mean values and energies, by Simpson's rule on
 * each step between two events. electrical_j is copper_j and shaft_j and what magnetic_j has grown by; link_j
 * less electrical_j is heat of switches and diodes.
 */
typedef struct drivebench_bridge_means {
  uint64_t since_ps; /**< time of the mark */
  double time_s;     /**< since then; with 0 all means are 0 */
  double current_a[3];
  double terminal_v[3]; /**< against the negative rail */
  double bus_v;         /**< of the starts of the steps, which have it as constant */
  double link_a;        /**< out of the link into the legs */
  double torque_nm;
  double speed_rad_s;
  double link_j;       /**< out of the link into the legs */
  double electrical_j; /**< into the terminals */
  double copper_j;     /**< losses of the machine */
  double shaft_j;      /**< onto the shaft */
} drivebench_bridge_means;

DRIVEBENCH_API int drivebench_bridge_open_abi(const char* address, uint32_t axis, uint32_t abi,
                                              size_t state_size, size_t means_size,
                                              drivebench_bridge** bridge);

/** Opens axis `axis` of "inproc:BENCH" or "shm:PATH" at gate level, with all legs open. After a failure
 * *bridge is null and drivebench_bridge_error(NULL) says why. */
static inline int drivebench_bridge_open(const char* address, uint32_t axis, drivebench_bridge** bridge) {
  return drivebench_bridge_open_abi(address, axis, DRIVEBENCH_ABI, sizeof(drivebench_bridge_state),
                                    sizeof(drivebench_bridge_means), bridge);
}
DRIVEBENCH_API void drivebench_bridge_close(drivebench_bridge* bridge);
/** Why the last call on this bridge failed; null: of this thread's last open. "" if it did not. */
DRIVEBENCH_API const char* drivebench_bridge_error(const drivebench_bridge* bridge);

/** Sets leg 0 (a), 1 (b) or 2 (c) from now on: legs that are set one after the other change together. */
DRIVEBENCH_API int drivebench_bridge_set(drivebench_bridge* bridge, uint32_t leg,
                                         const drivebench_leg* setting);

/**
 * Runs to `until_ps`, and writes the edges up to there in the order of time; `*count` is their number. The
 * run ends early at the edge that fills `room`: with room for one it goes to the next event. `edges` and
 * `count` may be null with a room of 0: then edges are left out. An edge that a leg's change at `until_ps`
 * brings at once belongs to the next run. `now_ps` (may be null) is the time after it.
 */
DRIVEBENCH_API int drivebench_bridge_run(drivebench_bridge* bridge, uint64_t until_ps,
                                         drivebench_bridge_edge* edges, size_t room, size_t* count,
                                         uint64_t* now_ps);
/** The first edge up to `limit_ps` if nothing is set before; `*found` 0: there is none. Time stays. A server
 * looks 1 s ahead at most. */
DRIVEBENCH_API int drivebench_bridge_next_edge(drivebench_bridge* bridge, uint64_t limit_ps,
                                               drivebench_bridge_edge* edge, int32_t* found);

DRIVEBENCH_API int drivebench_bridge_read(drivebench_bridge* bridge, drivebench_bridge_state* state);
DRIVEBENCH_API int drivebench_bridge_mark(drivebench_bridge* bridge);
DRIVEBENCH_API int drivebench_bridge_mean(drivebench_bridge* bridge, drivebench_bridge_means* means);

/** The load torque [N*m] from now on; positive opposes a positive torque of the machine. */
DRIVEBENCH_API int drivebench_bridge_set_load(drivebench_bridge* bridge, double load_nm);
/** Reads a parameter of the axis by the name that drivebench_describe() gives it. */
DRIVEBENCH_API int drivebench_bridge_get_parameter(drivebench_bridge* bridge, const char* name,
                                                   double* value);
/** Writes one that is live, from now on: a resistance, a friction, the supply. Saved with the state. */
DRIVEBENCH_API int drivebench_bridge_set_parameter(drivebench_bridge* bridge, const char* name, double value);
/** Puts a fault in force, as drivebench_inject() does, from now on; 0 takes it away. A fault of the gate
 * driver acts from the next tick of the bench file on; one of a Hall line changes the line without an edge.
 */
DRIVEBENCH_API int drivebench_bridge_inject(drivebench_bridge* bridge, const char* name, double value);
/** Clears latched faults; the legs close again with the next tick of the bench file. */
DRIVEBENCH_API int drivebench_bridge_clear(drivebench_bridge* bridge);

/** The whole state, as drivebench_save() gives it: for a bridge of the same bench file and build. */
DRIVEBENCH_API int drivebench_bridge_save(drivebench_bridge* bridge, void* state, size_t* size);
DRIVEBENCH_API int drivebench_bridge_restore(drivebench_bridge* bridge, const void* state, size_t size);

#ifdef __cplusplus
}
#endif

#endif
