#pragma once

#include <vector>

#include "tests/benchmark/harness/report.hpp"

/// The measurements, each file with a namespace of its name (or of its plural, where the product has one of
/// that name), as long as plan() says. They throw when something does not work at all.
namespace drivebench::speed {

/// A whole tick against the bare integration of the same substeps.
namespace tick {
std::vector<Row> measure();
}
/// A step of each kind of machine against a straight line, their ticks with all sensors, the switched
/// inverter and a dynamometer.
namespace machines {
std::vector<Row> measure();
}
/// Free mode with recording, on one CPU, against real time.
namespace free_mode {
std::vector<Row> measure();
}
/// A lockstep exchange against a blocking ping-pong of the same sizes.
namespace exchange {
std::vector<Row> measure();
}
/// A lockstep exchange through shared memory against two processes that wake each other by a futex.
namespace shared_memory {
std::vector<Row> measure();
}
/// A step of the bench in process behind the C ABI against the same step without it.
namespace sdk {
std::vector<Row> measure();
}
/// The gate level behind the C ABI: a run in which nothing is due, one to the next edge, and the time that a
/// simulated second of a speed controller takes.
namespace bridge {
std::vector<Row> measure();
}
/// The pacers against a bare clock_nanosleep loop; the server in real time.
namespace realtime {
std::vector<Row> measure();
}
/// Ten axes at 20 kHz into the recorder.
namespace recorder {
std::vector<Row> measure();
}
/// Resident memory of the server with a controller and 32 viewers.
namespace memory {
std::vector<Row> measure();
}

/// Controllers alone, and with their benches in one process.
namespace controllers {
std::vector<Row> measure();
}

/// The data of an experiment on their way to a client against a copy of as many bytes.
namespace experiment {
std::vector<Row> measure();
}

/// The identification of an induction motor, and of 800 random motors with their experiments.
namespace identifications {
std::vector<Row> measure();
}

/// `drivebench test`: its speed over presets, on one core and on two, what checks and a single case cost.
namespace suite {
std::vector<Row> measure();
}
/// `drivebench test --merge` of 100,000 results: time, memory and the size of the page.
namespace merge {
std::vector<Row> measure();
}

/// Encoding and decoding of one CAN frame.
namespace can_codec {
std::vector<Row> measure();
}
namespace can_exchange {
/// A lockstep exchange over udp_multicast against a ping-pong of the same datagrams.
std::vector<Row> measure_multicast();
/// The same over the kernel's CAN; without it, a row that says how to get it.
std::vector<Row> measure_socketcan();
}  // namespace can_exchange
/// A lockstep exchange by Modbus function 23 against plain libmodbus.
namespace modbus_exchange {
std::vector<Row> measure();
}
/// A healthy client beside 1,000 idle clients, 32 viewers, and 50 clients that never read.
namespace crowd {
std::vector<Row> measure();
}
/// The ticks of a bench beside hostile clients, against the same clients at another server.
namespace attacks {
std::vector<Row> measure();
}
/// A polite Modbus client beside abusers, and beside plain libmodbus.
namespace abuse {
std::vector<Row> measure();
}

}  // namespace drivebench::speed
