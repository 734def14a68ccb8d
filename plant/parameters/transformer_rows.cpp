#include "plant/parameters/transformer_rows.hpp"

#include <array>

#include "plant/parameters/rows.hpp"

namespace drivebench {
namespace {

using Transformer = TransformerParameters;

template <auto Member>
constexpr auto transformer = row<&AxisParameters::drive, &DriveParameters::transformer, Member>;

constexpr auto kTransformerTable = std::to_array<Parameter>({
    transformer<&Transformer::turns_ratio>(
        "transformer.turns_ratio", "1", 0, 1e4, kReal,
        "secondary over primary, of a transformer in each phase of a source; 0: none"),
    transformer<&Transformer::primary_resistance_ohm>("transformer.primary_resistance_ohm", "ohm", 0, 1e6,
                                                      kLive, "of the winding at the source"),
    transformer<&Transformer::primary_leakage_h>("transformer.primary_leakage_h", "H", 0, 1e3, kReal,
                                                 "of the winding at the source"),
    transformer<&Transformer::magnetising_inductance_h>("transformer.magnetising_inductance_h", "H", 0, 1e6,
                                                        kReal, "seen from the source"),
    transformer<&Transformer::secondary_resistance_ohm>("transformer.secondary_resistance_ohm", "ohm", 0, 1e6,
                                                        kLive, "of the winding at the machine"),
    transformer<&Transformer::secondary_leakage_h>("transformer.secondary_leakage_h", "H", 0, 1e3, kReal,
                                                   "of the winding at the machine"),
});

bool has_values(const Transformer& t) noexcept {
  return t.primary_resistance_ohm > 0.0 || t.primary_leakage_h > 0.0 || t.magnetising_inductance_h > 0.0 ||
         t.secondary_resistance_ohm > 0.0 || t.secondary_leakage_h > 0.0;
}

}  // namespace

std::span<const Parameter> transformer_rows() noexcept {
  return kTransformerTable;
}

void add_transformer_problems(const DriveParameters& p, Problems& found) {
  const Transformer& t = p.transformer;
  if (!has_transformer(t)) {
    if (has_values(t)) {
      found.add("transformer.turns_ratio",
                "is 0 but must be above 0 for a transformer, which other keys of this section describe");
    }
    return;
  }
  if (p.kind != DriveKind::kSource) {
    found.add("transformer.turns_ratio", [&] {
      return "is " + text(t.turns_ratio) +
             " but must be 0 without drive.kind = \"source\": a transformer stands behind a source";
    });
  }
  if (!(t.magnetising_inductance_h > 0.0)) {
    found.add("transformer.magnetising_inductance_h", [&] {
      return "is 0 but must be above 0 for a transformer: turns_ratio is " + text(t.turns_ratio);
    });
  }
  if (p.source.start_capacitance_f > 0.0) {
    found.add("source.start_capacitance_f", [&] {
      return "is " + text(p.source.start_capacitance_f) +
             " but must be 0 with a transformer: each phase has a transformer of its own";
    });
  }
  if (p.source.start_switch) {
    found.add("source.start_switch", "is 1 but must be 0 with a transformer: it would short phase b's");
  }
}

}  // namespace drivebench
