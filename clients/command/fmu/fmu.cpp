#include "clients/command/fmu/fmu.hpp"

#include <dlfcn.h>
#include <fmt/core.h>
#include <link.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/archive/zip_writer.hpp"
#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "clients/command/common/basics/output.hpp"
#include "clients/command/common/programs/composed_file.hpp"
#include "clients/command/common/programs/installation.hpp"
#include "clients/command/common/programs/temporary_folder.hpp"
#include "clients/fmu/fmu_resources.hpp"
#include "clients/fmu/model_description.hpp"
#include "clients/sdk/drivebench.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace fs = std::filesystem;
namespace {

constexpr const char* kLibrary = "libdrivebench-fmu.so.1";

/// The file of the library that a unit carries: where the loader finds it.
fs::path library_file() {
  void* const library = ::dlopen(kLibrary, RTLD_LAZY | RTLD_LOCAL);
  if (library == nullptr) {
    throw std::runtime_error(
        fmt::format("fmu needs the library {}, which comes with drivebench: {}", kLibrary, ::dlerror()));
  }
  link_map* place = nullptr;
  ::dlinfo(library, RTLD_DI_LINKMAP, static_cast<void*>(&place));
  fs::path file = place->l_name;
  ::dlclose(library);
  return file;
}

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return bytes;
}

client::Bench opened(const fs::path& composed) {
  try {
    return client::Bench("inproc:" + composed.string());
  } catch (const client::Error& refusal) {
    throw UsageError(about_the_bench(refusal.what(), composed));
  }
}

/// Which axes have a lease of their own.
fmi::IsCommanded commanded_axes(client::Bench& bench) {
  fmi::IsCommanded commanded;
  for (std::uint32_t axis = 0; axis < bench.describe().axis_count; ++axis) {
    try {
      bench.acquire(axis);
      commanded.push_back(true);
    } catch (const client::Error& refusal) {
      if (refusal.code() != DRIVEBENCH_SHARED_AMPLIFIER) throw;
      commanded.push_back(false);
    }
  }
  return commanded;
}

struct Unit {
  std::string name;  ///< of the bench
  std::size_t variables;
  std::vector<archive::Entry> entries;
};

Unit unit_of(const fs::path& bench_file, fmu::Fmi version) {
  const std::vector<archive::Entry> resources = fmu::resources_of(bench_file);
  const TemporaryFolder folder;
  for (const archive::Entry& file : resources)
    write_file(folder.path() / file.name, file.bytes);
  client::Bench bench = opened(folder.path() / "bench.toml");
  const auto variables = fmi::variables_of(bench.describe(), commanded_axes(bench));

  const std::string name = bench.describe().name;
  const std::string_view platform = version == fmu::Fmi::k2 ? "linux64" : "x86_64-linux";
  Unit unit{.name = name, .variables = variables.size(), .entries = {}};
  unit.entries.push_back({.name = "modelDescription.xml",
                          .bytes = fmu::model_description(bench.describe(), variables, version)});
  unit.entries.push_back({.name = fmt::format("binaries/{}/{}.so", platform, fmi::identifier_of(name)),
                          .bytes = bytes_of(library_file())});
  for (const archive::Entry& file : resources)
    unit.entries.push_back({.name = "resources/" + file.name, .bytes = file.bytes});
  return unit;
}

}  // namespace

int run_fmu(const FmuOptions& options) {
  if (!options.out_file.empty()) check_suffix(options.out_file, {".fmu"});
  const fs::path bench_file = find_config(options.bench);
  try {
    const Unit unit = unit_of(bench_file, options.fmi == 2 ? fmu::Fmi::k2 : fmu::Fmi::k3);
    const std::string out = options.out_file.empty() ? unit.name + ".fmu" : options.out_file;
    archive::write_zip(out, unit.entries);
    if (options.json) {
      fmt::print("{}\n", json_text(Json{{"out", out}, {"fmi", options.fmi}, {"variables", unit.variables}}));
    } else {
      fmt::print("fmu: {} as FMI {}.0 for co-simulation, {} variables, to {}\n", unit.name, options.fmi,
                 unit.variables, out);
    }
  } catch (const archive::ZipError& failure) {
    throw UsageError(failure.what());
  }
  return kExitOk;
}

}  // namespace drivebench::command
