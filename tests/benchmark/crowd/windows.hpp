#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "clients/link/tcp/tcp_link.hpp"
#include "tests/benchmark/harness/report.hpp"

namespace drivebench::speed {

/// Answer times of one healthy client that asks for the newest sample 500 times a second, and the late ticks
/// of the bench meanwhile.
struct Window {
  double p99_us = 0.0;
  double ticks = 0.0;
  double late_ticks = 0.0;
};

struct Windows {
  std::vector<Window> alone;
  std::vector<Window> beside;
  std::vector<Window> elsewhere;  ///< the same clients at another server: their load on the machine alone
};

/// Makes the clients at an address; they are there as long as the result.
using Company = std::function<std::shared_ptr<void>(const std::string& address)>;

/// Windows of each kind in turn; `other` is the bench file of another server.
Windows in_turn(link::Link& client, const std::string& here, const std::string& other, const Company& come);

/// In the median window, of 10,000 ticks: a stall of the machine makes a hundred ticks late in one.
double late_per_10000(const std::vector<Window>& windows);

/// The row of the late ticks beside these clients, against the same clients at another server.
Row late_ticks_row(const std::string& beside, const Windows& windows, const Disturbance& disturbance);

/// A new file with this text.
std::filesystem::path written(std::filesystem::path file, const std::string& text);

}  // namespace drivebench::speed
