#include "clients/command/common/programs/composed_file.hpp"

#include <fstream>
#include <stdexcept>

namespace drivebench::command {

void write_file(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream out(file, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

std::string about_the_bench(std::string sentence, const std::filesystem::path& composed) {
  const std::string path = composed.string();
  for (std::size_t at = sentence.find(path); at != std::string::npos; at = sentence.find(path, at))
    sentence.replace(at, path.size(), "the composed bench");
  return sentence;
}

}  // namespace drivebench::command
