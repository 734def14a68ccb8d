#include "protocols/pages/write_pages.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "protocols/text.hpp"

namespace drivebench::pages {
namespace {

namespace fs = std::filesystem;

void write_file(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream out(file);
  out << text;
  out.close();
  if (!out)
    throw CLI::ValidationError("--write-pages", printable(file.string()) + ": " + std::strerror(errno));
}

/// Of SOURCE_DATE_EPOCH, so that a build can be repeated bit for bit, or else today.
std::string date() {
  const char* chosen = std::getenv("SOURCE_DATE_EPOCH");
  const std::time_t now = chosen != nullptr ? std::strtoll(chosen, nullptr, 10) : std::time(nullptr);
  std::tm parts{};
  std::array<char, 32> text{};
  ::gmtime_r(&now, &parts);
  std::strftime(text.data(), text.size(), "%Y-%m-%d", &parts);
  return text.data();
}

void write(const CLI::App& app, const Program& program, const fs::path& folder) {
  const LineVerb line = describe_line(app, program.name);
  const CompletionFacts facts = program.facts();
  const ManHead head = {
      .section = program.section, .version = program.version, .date = date(), .see_also = program.see_also};
  for (const LineVerb* verb : all_verbs(line)) {
    const std::string page = joined(verb->path, "-") + "." + program.section;
    write_file(folder / "man" / ("man" + program.section) / page, man_page(*verb, head));
  }
  write_file(folder / "bash-completion/completions" / program.name, bash_completion(line, facts));
  write_file(folder / "zsh/site-functions" / ("_" + program.name), zsh_completion(line, facts));
}

}  // namespace

void add_write_pages(CLI::App& app, const Program& program) {
  app.add_option_function<std::string>(
         "--write-pages",
         [&app, program](const std::string& folder) {
           try {
             write(app, program, folder);
           } catch (const fs::filesystem_error& error) {
             throw CLI::ValidationError("--write-pages", printable(folder) + ": " + error.code().message());
           }
           throw CLI::Success();
         },
         "write man pages, and completions for bash and zsh, into a folder like ~/.local/share, and end")
      ->type_name("FOLDER");
}

}  // namespace drivebench::pages
