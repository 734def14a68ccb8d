#pragma once

#include <functional>
#include <string>

#include "protocols/pages/completion.hpp"
#include "protocols/pages/man_page.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): as CLI11 names it
class App;
}

namespace drivebench::pages {

/// A program whose command line is described.
struct Program {
  std::string name{};
  std::string version{};
  std::string section = "1";  ///< of its man pages: 1 for a command, 8 for a service
  std::vector<std::string> see_also{};
  std::vector<VerbGroup> groups{};  ///< of its verbs, in their order
  std::function<CompletionFacts()> facts = [] { return CompletionFacts{}; };
};

/// Gives --help and errors their form, for the verbs that are added later too. Adds the option --write-pages
/// FOLDER, which writes what man, bash and zsh read about the program where they look for it below
/// /usr/share, and ends the program.
void add_pages(CLI::App& app, const Program& program);

}  // namespace drivebench::pages
