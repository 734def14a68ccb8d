#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "clients/identification/data/measured_data.hpp"
#include "protocols/signals/catalogue.hpp"
#include "tests/book/book_bench.hpp"

namespace drivebench::identification {

/// A bench file of configs/benches.
inline BenchConfig bench_config(const std::string& name) {
  return load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/" + name + ".toml");
}

/// Another sampling rate with integration steps of about the same length.
inline void set_rate(BenchConfig& config, std::int64_t period_ns, int substeps) {
  config.setup.period_ns = period_ns;
  config.setup.substeps = substeps;
}

/// Records as a client would: signals of the catalogue, one sample of `every`. The true signals of `truths`
/// take the place of the measured ones: {"i_a_a", "true_i_a_a"}.
class Recorder {
 public:
  Recorder(std::initializer_list<std::string_view> signals, double period_s, int every = 1) : every_(every) {
    data_.period_s = period_s * every;
    for (const std::string_view name : signals) {
      const std::size_t equal = name.find('=');
      const std::string_view source = equal == std::string_view::npos ? name : name.substr(equal + 1);
      sources_.push_back(find_signal(source));
      data_.columns.push_back({std::string(name.substr(0, equal)), std::string(sources_.back()->unit), {}});
    }
  }
  void operator()(const Sample& sample) {
    if (count_++ % every_ != 0) return;
    for (std::size_t k = 0; k < sources_.size(); ++k)
      data_.columns[k].values.push_back(value_of(*sources_[k], sample));
  }
  MeasuredData& data() { return data_; }

 private:
  std::vector<const Signal*> sources_;
  int every_;
  int count_ = 0;
  MeasuredData data_;
};

/// The recorder of a line start with sensors; `ideal`: of true currents and angle.
inline Recorder line_recorder(double period_s, bool ideal) {
  if (ideal) {
    return Recorder({"i_a_a=true_i_a_a", "i_b_a=true_i_b_a", "i_c_a=true_i_c_a", "u_a_v", "u_b_v", "u_c_v",
                     "angle_rad", "encoder_count"},
                    period_s);
  }
  return Recorder({"i_a_a", "i_b_a", "i_c_a", "u_a_v", "u_b_v", "u_c_v", "encoder_count"}, period_s);
}

/// Voltages of the line at the samples themselves, phase a at its peak at tick 0, in the place of the means
/// of the bench. The first sample of the record is that of tick `first`.
inline void put_line_voltages(MeasuredData& data, double amplitude_v, double frequency_hz, int first) {
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const std::string name = std::string("u_") + static_cast<char>('a' + phase) + "_v";
    for (Column& column : data.columns) {
      if (column.name != name) continue;
      for (std::size_t k = 0; k < column.values.size(); ++k) {
        const double time_s = data.period_s * (static_cast<double>(k) + first);
        column.values[k] = amplitude_v * std::cos(2.0 * std::numbers::pi *
                                                  (frequency_hz * time_s - static_cast<double>(phase) / 3.0));
      }
    }
  }
}

}  // namespace drivebench::identification
