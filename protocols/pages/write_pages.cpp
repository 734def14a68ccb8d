#include "protocols/pages/write_pages.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "protocols/pages/help_text.hpp"
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
  const LineVerb line = describe_line(app, program.name, program.groups);
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

/// CLI11's message about an error, without its words for types and verbs.
std::string in_our_words(const CLI::App*, const CLI::Error& error) {
  std::string text = error.what();
  if (error.get_name() == "ArgumentMismatch" && text.ends_with(" missing")) {
    text = text.substr(0, text.find(": ")) + ": its value is missing";
  } else if (text == "A subcommand is required") {
    text = "a verb is missing";
  }
  return text + "\nRun with --help for more information.\n";
}

}  // namespace

void add_pages(CLI::App& app, const Program& program) {
  app.set_help_flag("-h,--help", "print this help and end");
  app.failure_message(in_our_words);
  app.formatter_fn([program](const CLI::App* verb, const std::string&, CLI::AppFormatMode) {
    return help_text(describe_line(*verb, program.name, program.groups));
  });
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
      ->type_name("FOLDER")
      ->group(kHelp);
}

}  // namespace drivebench::pages
