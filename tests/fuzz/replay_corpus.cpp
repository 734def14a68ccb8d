// The main() of a fuzz target outside libFuzzer: every file of a folder, then mutations of them, the same
// each time.
//
//   fuzz_NAME FOLDER COUNT    all files and COUNT mutations
//   fuzz_NAME FILE            this one, for example the crash-NAME.bin that a failure left behind
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz.hpp"

#ifdef __clang__
// A report of the sanitizer ends in abort(), so that the bytes are saved below.
extern "C" const char* __asan_default_options() {  // NOLINT(bugprone-reserved-identifier)
  return "abort_on_error=1";
}
#endif

namespace drivebench::fuzz {
namespace {
namespace fs = std::filesystem;

using Bytes = std::vector<std::uint8_t>;
using Random = std::mt19937_64;

constexpr std::uint64_t kSeed = 20051130;
constexpr std::size_t kMaxBytes = std::size_t{64} * 1024;
constexpr unsigned kHangsAfter_s = 30;

std::string crash_file;
const Bytes* current = nullptr;

/// Keeps the bytes that broke a promise.
void save_and_die(int signal) {
  const int file = ::open(crash_file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0644);
  if (current != nullptr && file >= 0 && ::write(file, current->data(), current->size()) >= 0) {
    constexpr char kSaid[] = "fuzz: the bytes are in ";
    static_cast<void>(!::write(STDERR_FILENO, kSaid, sizeof kSaid - 1));
    static_cast<void>(!::write(STDERR_FILENO, crash_file.data(), crash_file.size()));
    static_cast<void>(!::write(STDERR_FILENO, "\n", 1));
  }
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

void run(const Bytes& bytes) {
  // A copy of exactly this size, so that the sanitizer sees one byte too many.
  const Bytes exact(bytes);
  current = &exact;
  ::alarm(kHangsAfter_s);
  LLVMFuzzerTestOneInput(exact.data(), exact.size());
  current = nullptr;
}

std::size_t below(Random& random, std::size_t limit) {
  return limit == 0 ? 0 : static_cast<std::size_t>(random() % limit);
}

/// Numbers at which lengths, ticks and counts overflow.
std::uint64_t odd_number(Random& random) {
  constexpr std::uint64_t kOdd[] = {0,
                                    1,
                                    0x7f,
                                    0x80,
                                    0xff,
                                    0x7fff,
                                    0xffff,
                                    0x7fffffff,
                                    0x80000000,
                                    0xffffffff,
                                    0x7fffffffffffffff,
                                    0x8000000000000000,
                                    0xfffffffffffffff7,
                                    ~0ULL};
  return kOdd[below(random, std::size(kOdd))];
}

void mutate_once(Bytes& bytes, const Bytes& other, Random& random) {
  const std::size_t at = below(random, bytes.size() + 1);
  const auto place = bytes.begin() + static_cast<std::ptrdiff_t>(at);
  const std::size_t left = bytes.size() - at;
  const auto some = static_cast<std::ptrdiff_t>(std::min(left, below(random, 40) + 1));
  switch (below(random, 7)) {
    case 0:  // a bit
      if (left > 0) bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1U << below(random, 8));
      return;
    case 1:  // a byte
      if (left > 0) bytes[at] = static_cast<std::uint8_t>(random());
      return;
    case 2: {  // a number
      const std::uint64_t number = odd_number(random);
      std::memcpy(bytes.data() + at, &number, std::min(left, std::size_t{1} << below(random, 4)));
      return;
    }
    case 3:  // a part removed
      bytes.erase(place, place + some);
      return;
    case 4: {  // a part doubled
      const Bytes part(place, place + some);
      bytes.insert(place, part.begin(), part.end());
      return;
    }
    case 5:  // the rest removed
      if (below(random, 4) == 0) bytes.resize(at);
      return;
    default: {  // a part of another file
      const std::size_t from = below(random, other.size() + 1);
      const std::size_t count = std::min(other.size() - from, below(random, 64));
      const auto begin = other.begin() + static_cast<std::ptrdiff_t>(from);
      bytes.insert(place, begin, begin + static_cast<std::ptrdiff_t>(count));
      return;
    }
  }
}

Bytes read_file(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(file), {});
}

/// In the order of their names: mutations must not depend on the file system.
std::vector<Bytes> read_corpus(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    paths.push_back(entry.path());
  std::ranges::sort(paths);
  std::vector<Bytes> corpus;
  corpus.reserve(paths.size());
  for (const fs::path& path : paths)
    corpus.push_back(read_file(path));
  return corpus;
}

void run_mutations(const std::vector<Bytes>& corpus, std::size_t count) {
  Random random(kSeed);
  for (std::size_t i = 0; i < count; ++i) {
    Bytes bytes = corpus[i % corpus.size()];
    for (std::size_t changes = below(random, 4) + 1; changes > 0; --changes)
      mutate_once(bytes, corpus[below(random, corpus.size())], random);
    if (bytes.size() > kMaxBytes) bytes.resize(kMaxBytes);
    run(bytes);
  }
}

}  // namespace
}  // namespace drivebench::fuzz

int main(int argc, char** argv) {
  using namespace drivebench::fuzz;
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "usage: %s FOLDER COUNT | FILE\n", argv[0]);
    return 2;
  }
  crash_file = "crash-" + fs::path(argv[0]).filename().string() + ".bin";
  std::signal(SIGABRT, save_and_die);
  std::signal(SIGALRM, save_and_die);
  if (!fs::is_directory(argv[1])) {
    run(read_file(argv[1]));
    return 0;
  }
  const std::vector<Bytes> corpus = read_corpus(argv[1]);
  require(!corpus.empty(), "the corpus has files");
  for (const Bytes& bytes : corpus)
    run(bytes);
  const std::size_t count = argc == 3 ? std::strtoull(argv[2], nullptr, 10) : 0;
  run_mutations(corpus, count);
  std::printf("%zu files and %zu mutations of them: no promise broken\n", corpus.size(), count);
  return 0;
}
