#pragma once

#include <vector>

#include "tests/benchmark/harness/report.hpp"

/// The measurements, one file each, as long as plan() says. They throw when something does not work at all.
namespace drivebench::speed {

/// A whole tick against the bare integration of the same substeps.
std::vector<Row> measure_tick();
/// A step of each kind of machine against a straight line, their ticks with all sensors, the switched
/// inverter and a dynamometer.
std::vector<Row> measure_machines();
/// Free mode with recording, on one CPU, against real time.
std::vector<Row> measure_free_mode();
/// A lockstep exchange against a blocking ping-pong of the same sizes.
std::vector<Row> measure_exchange();
/// A lockstep exchange through shared memory against two processes that wake each other by a futex.
std::vector<Row> measure_shared_memory();
/// A step of the bench in process behind the C ABI against the same step without it.
std::vector<Row> measure_sdk();
/// The gate level behind the C ABI: a run in which nothing is due, one to the next edge, and the time that a
/// simulated second of a speed controller takes.
std::vector<Row> measure_bridge();
/// The pacers against a bare clock_nanosleep loop; the server in real time.
std::vector<Row> measure_realtime();
/// Ten axes at 20 kHz into the recorder.
std::vector<Row> measure_recorder();
/// Resident memory of the server with a controller and 32 viewers.
std::vector<Row> measure_memory();

/// Controllers alone, and with their benches in one process.
std::vector<Row> measure_control();

/// The data of an experiment on their way to a client against a copy of as many bytes.
std::vector<Row> measure_experiment();

/// The identification of an induction motor, and of 800 random motors with their experiments.
std::vector<Row> measure_identification();

/// `drivebench test`: its speed over presets, on one core and on two, what checks and a single case cost.
std::vector<Row> measure_suite();
/// `drivebench test --merge` of 100,000 results: time, memory and the size of the page.
std::vector<Row> measure_merge();

/// Encoding and decoding of one CAN frame.
std::vector<Row> measure_can_codec();
/// A lockstep exchange over udp_multicast against a ping-pong of the same datagrams.
std::vector<Row> measure_multicast();
/// The same over the kernel's CAN; without it, a row that says how to get it.
std::vector<Row> measure_socketcan();
/// A lockstep exchange by Modbus function 23 against plain libmodbus.
std::vector<Row> measure_modbus();
/// A healthy client beside 1,000 idle clients, 32 viewers, and 50 clients that never read.
std::vector<Row> measure_crowd();
/// The ticks of a bench beside hostile clients, against the same clients at another server.
std::vector<Row> measure_attacks();
/// A polite Modbus client beside abusers, and beside plain libmodbus.
std::vector<Row> measure_abuse();

}  // namespace drivebench::speed
