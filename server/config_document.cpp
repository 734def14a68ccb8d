#include "server/config_document.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <system_error>
#include <tuple>
#include <utility>

namespace {

/// toml++ 3.3 found itself in a state it thinks impossible.
struct ParserConfused {};

constexpr void check_parser(bool holds) {
  if (!holds) throw ParserConfused();
}

}  // namespace

// "[[[a]]]" breaks assertions of toml++ (its pull request 301), which without NDEBUG abort the program and
// with it are promises to the optimiser. Here they throw, in all builds; nothing else includes the library.
#undef NDEBUG
#define TOML_ASSERT(expression) check_parser(static_cast<bool>(expression))
#define TOML_ENABLE_FORMATTERS 0
#define TOML_MAX_NESTED_VALUES 16
#include <toml++/toml.h>

namespace drivebench {
namespace {

// A dotted key nests a table per dot. Short lines keep that, and the recursion over it, from filling the
// stack.
constexpr std::size_t kMaxLineBytes = 1000;

int line_of(const toml::source_region& source) {
  return static_cast<int>(source.begin.line);
}

void set_scalar(ConfigNode& node, const toml::node& source) {
  node.kind = ConfigNode::Kind::kScalar;
  if (const auto* text = source.as_string()) {
    node.scalar = text->get();
  } else if (const auto* integer = source.as_integer()) {
    if (integer->flags() == toml::value_flags::none) {
      node.scalar = integer->get();
    } else {
      node.scalar = ConfigNode::Other{"a number that is not decimal"};
    }
  } else if (const auto* real = source.as_floating_point()) {
    node.scalar = real->get();
  } else if (const auto* boolean = source.as_boolean()) {
    node.scalar = boolean->get();
  } else {
    node.scalar = ConfigNode::Other{"a date or time"};
  }
}

ConfigNode converted(const toml::node& source) {
  ConfigNode node;
  node.line = line_of(source.source());
  if (const auto* table = source.as_table()) {
    for (const auto& [key, value] : *table) {
      node.children.push_back(converted(value));
      node.children.back().key = std::string(key.str());
      node.children.back().line = line_of(key.source());
    }
  } else if (const auto* array = source.as_array()) {
    node.kind = ConfigNode::Kind::kArray;
    for (const toml::node& value : *array)
      node.children.push_back(converted(value));
  } else {
    set_scalar(node, source);
  }
  return node;
}

/// Whether the parser gets through the text or refuses it in good order.
bool is_parsable(std::string_view text) {
  try {
    static_cast<void>(toml::parse(text));
  } catch (const toml::parse_error&) {
  } catch (const ParserConfused&) {
    return false;
  }
  return true;
}

/// The line that confuses the parser: the first up to which it is confused.
int confusing_line(std::string_view text) {
  std::vector<std::size_t> ends;
  for (std::size_t end = 0; end < text.size(); ++end) {
    if (text[end] == '\n' || end + 1 == text.size()) ends.push_back(end + 1);
  }
  const auto found = std::partition_point(ends.begin(), ends.end(),
                                          [&](std::size_t end) { return is_parsable(text.substr(0, end)); });
  return static_cast<int>(found - ends.begin()) + 1;
}

/// Line of the first overlong line, or 0.
int overlong_line(std::string_view text) {
  int line = 1;
  for (std::size_t start = 0; start < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    if (end - start > kMaxLineBytes) return line;
    start = end + 1;
  }
  return 0;
}

class Descriptor {
 public:
  explicit Descriptor(int value) noexcept : value_(value) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  int get() const noexcept { return value_; }

 private:
  int value_;
};

std::string reason(int error) {
  return "cannot be read: " + std::generic_category().message(error);
}

}  // namespace

void ProblemList::add(const std::string& file, int line, std::string key, std::string rule) {
  if (problems_.size() < kMost) {
    problems_.push_back({file, line, std::move(key), std::move(rule)});
  } else {
    ++dropped_;
  }
}

void ProblemList::throw_if_any() {
  if (problems_.empty()) return;
  const auto place = [](const ConfigProblem& p) { return std::tie(p.file, p.line, p.key, p.rule); };
  std::stable_sort(problems_.begin(), problems_.end(),
                   [&](const auto& x, const auto& y) { return place(x) < place(y); });
  // Two axes with the same motor file find the same problems in it.
  problems_.erase(std::unique(problems_.begin(), problems_.end(),
                              [&](const auto& x, const auto& y) { return place(x) == place(y); }),
                  problems_.end());
  if (dropped_ > 0) {
    problems_.push_back({problems_.back().file, 0, {}, "and " + std::to_string(dropped_) + " more problems"});
  }
  throw ConfigError(std::move(problems_));
}

std::optional<ConfigNode> parse_document(std::string_view text, const std::string& file,
                                         ProblemList& problems) {
  if (text.size() > kMaxConfigBytes) {
    problems.add(file, 0, {}, "is larger than " + std::to_string(kMaxConfigBytes) + " bytes");
    return std::nullopt;
  }
  if (const int line = overlong_line(text); line != 0) {
    problems.add(file, line, {}, "the line is longer than " + std::to_string(kMaxLineBytes) + " bytes");
    return std::nullopt;
  }
  try {
    return converted(toml::parse(text));
  } catch (const toml::parse_error& error) {
    problems.add(file, line_of(error.source()), {}, printable(error.description()));
  } catch (const ParserConfused&) {
    problems.add(file, confusing_line(text), {}, "is not TOML: no key or value can begin like this");
  }
  return std::nullopt;
}

FileText read_file(const std::filesystem::path& file, std::size_t limit) {
  // Not blocking, so that a pipe without a writer is refused below and not waited for.
  const Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0)
    return {.text{}, .why_not = reason(errno)};
  if (S_ISDIR(status.st_mode)) return {.text{}, .why_not = "is a directory"};
  if (!S_ISREG(status.st_mode)) return {.text{}, .why_not = "is not a regular file"};

  FileText result{.text{}, .why_not{}, .others_may_read = (status.st_mode & (S_IRWXG | S_IRWXO)) != 0};
  std::array<char, 4096> buffer{};
  while (true) {
    const ssize_t size = ::read(descriptor.get(), buffer.data(), buffer.size());
    if (size < 0) return {.text{}, .why_not = reason(errno)};
    if (size == 0) return result;
    result.text.append(buffer.data(), static_cast<std::size_t>(size));
    if (result.text.size() > limit) {
      return {.text{}, .why_not = "is larger than " + std::to_string(limit) + " bytes"};
    }
  }
}

std::string printable(std::string_view text) {
  constexpr std::size_t kMost = 160;
  const auto continues = [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u; };
  std::size_t size = std::min(text.size(), kMost);
  while (size < text.size() && size > 0 && continues(text[size]))
    --size;
  std::string result;
  for (const char c : text.substr(0, size)) {
    const auto code = static_cast<unsigned char>(c);
    result += code < 0x20 || code == 0x7F ? '?' : c;
  }
  return size < text.size() ? result + "..." : result;
}

std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

}  // namespace drivebench
