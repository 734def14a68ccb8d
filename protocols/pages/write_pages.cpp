#include "protocols/pages/write_pages.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>

#include "protocols/nearest_name.hpp"
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

/// The verb that the user named, with the verbs around it: "drivebench new motor"; the program where none is.
std::string path_of(const CLI::App& verb) {
  const CLI::App* const around = verb.get_parent();
  return around == nullptr ? verb.get_name() : path_of(*around) + " " + verb.get_name();
}

const CLI::App& named_verb(const CLI::App& app) {
  const std::vector<CLI::App*> named = app.get_subcommands();
  return named.empty() ? app : named_verb(*named.back());
}

bool is_option(std::string_view word) {
  return word.size() > 1 && word[0] == '-' && std::isdigit(static_cast<unsigned char>(word[1])) == 0;
}

/// About the first word that a verb does not know: of an option first, because the words behind it may be its
/// values.
std::string about_unknown_word(const CLI::App& app, std::string_view otherwise) {
  const std::vector<std::string> words = app.remaining(true);
  if (words.empty()) return std::string(otherwise);
  const CLI::App& verb = named_verb(app);
  const auto option = std::ranges::find_if(words, is_option);
  if (option == words.end()) {
    std::vector<std::string> verbs;
    for (const CLI::App* sub : verb.get_subcommands(nullptr))
      verbs.push_back(sub->get_name());
    return "`" + path_of(verb) + "` takes no " + (verbs.empty() ? "further word" : "verb") + " '" +
           printable(words.front()) + "'" + did_you_mean(words.front(), verbs);
  }
  std::vector<std::string> known;
  for (const CLI::Option* each : verb.get_options()) {
    if (!each->get_lnames().empty()) known.push_back("--" + each->get_lnames().front());
  }
  const std::string name = option->substr(0, option->find('='));
  return "`" + path_of(verb) + "` has no option " + printable(name) + did_you_mean(name, known);
}

/// `Could not convert: --repeat = 0.5`: validators refuse what a real number may not be, so that the option
/// takes whole ones.
std::string about_conversion(const std::string& text) {
  const std::size_t start = std::strlen("Could not convert: ");
  const std::size_t equals = text.find(" = ", start);
  if (equals == std::string::npos) return text;
  const std::string value = text.substr(equals + 3);
  double number = 0.0;
  const bool is_number = CLI::detail::lexical_cast(value, number);
  return text.substr(start, equals - start) + ": " + printable(value) +
         (is_number ? " is not a whole number" : " is not a number");
}

/// `--format: matt not in {csv,mat}`, as CLI11 refuses what is no word of a choice.
std::string about_choice(const std::string& text) {
  const std::size_t list = text.find(" not in {");
  const std::size_t start = text.find(": ");
  if (list == std::string::npos || start > list || !text.ends_with('}')) return text;
  const std::string value = text.substr(start + 2, list - start - 2);
  std::vector<std::string> words = {""};
  for (const char each :
       text.substr(list + std::strlen(" not in {"), text.size() - 1 - list - std::strlen(" not in {"))) {
    if (each == ',') {
      words.emplace_back();
    } else {
      words.back() += each;
    }
  }
  return text.substr(0, start) + ": '" + printable(value) + "' is none of " + joined(words, ", ") +
         did_you_mean(value, words);
}

/// CLI11's message about an error, without its words for types and verbs.
std::string in_our_words(const CLI::App* app, const CLI::Error& error) {
  std::string text = error.what();
  const bool lacks_verb = text == "A subcommand is required";
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError) || lacks_verb) {
    text = about_unknown_word(*app, lacks_verb ? "a verb is missing" : text);
  } else if (error.get_name() == "ArgumentMismatch" && text.ends_with(" missing")) {
    text = text.substr(0, text.find(": ")) + ": its value is missing";
  } else if (error.get_name() == "ConversionError" && text.starts_with("Could not convert: ")) {
    text = about_conversion(text);
  } else if (error.get_name() == "ValidationError") {
    text = about_choice(text);
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
