#pragma once

#include <string>

#include "protocols/pages/line_description.hpp"

namespace drivebench::pages {

/// What every man page of a program has.
struct ManHead {
  std::string section = "1";
  std::string version{};
  std::string date{};                   ///< `2026-11-24`
  std::vector<std::string> see_also{};  ///< `drivebench-server(8)`
};

/// The man page of one verb, in the macros of man(7).
std::string man_page(const LineVerb& verb, const ManHead& head);

}  // namespace drivebench::pages
