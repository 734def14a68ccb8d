#include "clients/fmu/model_description.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <set>
#include <string_view>

#include "protocols/markup.hpp"
#include "protocols/text.hpp"

namespace drivebench::fmu {
namespace {

using fmi::Causality;
using fmi::Type;
using fmi::Variable;

/// What the two versions write alike; each adds its own elements.
class Description {
 public:
  Description(const drivebench_description& bench, const std::vector<Variable>& variables)
      : bench_(bench), variables_(variables) {}
  virtual ~Description() = default;
  Description(const Description&) = delete;
  Description& operator=(const Description&) = delete;

  std::string text() {
    line("<?xml version=\"1.0\" encoding=\"UTF-8\"?>");
    begin();
    units();
    line("  <LogCategories>");
    line(
        R"(    <Category name="logStatusWarning" description="what was asked is not done, and the run goes on"/>)");
    line(R"(    <Category name="logStatusError" description="a request that the bench refuses"/>)");
    line("  </LogCategories>");
    line("  <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"{}\"/>", shortest(bench_.period_s));
    line("  <ModelVariables>");
    for (std::size_t number = 0; number < variables_.size(); ++number)
      variable(number, variables_[number]);
    after_variables();
    line("  </ModelVariables>");
    line("  <ModelStructure>");
    structure();
    line("  </ModelStructure>");
    line("</fmiModelDescription>");
    return std::move(text_);
  }

 protected:
  template <class... Arguments>
  void line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Arguments>(arguments)...);
    text_ += '\n';
  }

  virtual void begin() = 0;
  virtual void variable(std::size_t number, const Variable& v) = 0;
  virtual void after_variables() {}
  virtual void structure() = 0;

  /// The attributes that both versions give to every variable.
  static std::string common(std::size_t number, const Variable& v) {
    const std::string_view causality = v.causality == Causality::kInput       ? "input"
                                       : v.causality == Causality::kParameter ? "parameter"
                                                                              : "output";
    const std::string_view variability = v.causality == Causality::kParameter ? "tunable" : "discrete";
    return fmt::format(R"(name="{}" valueReference="{}" description="{}" causality="{}" variability="{}")",
                       markup(v.name), number, markup(v.meaning), causality, variability);
  }

  /// Unit, limits and start, as far as the variable and its type have them.
  static std::string values(const Variable& v, bool is_real) {
    std::string text;
    if (is_real && !v.unit.empty()) text += fmt::format(" unit=\"{}\"", markup(v.unit));
    if (std::isfinite(v.minimum)) text += fmt::format(" min=\"{}\"", shortest(v.minimum));
    if (std::isfinite(v.maximum)) text += fmt::format(" max=\"{}\"", shortest(v.maximum));
    if (v.causality != Causality::kOutput) text += fmt::format(" start=\"{}\"", shortest(v.start));
    return text;
  }

  const drivebench_description& bench_;
  const std::vector<Variable>& variables_;

 private:
  void units() {
    std::set<std::string> units;
    for (const Variable& v : variables_) {
      if (!v.unit.empty()) units.insert(v.unit);
    }
    line("  <UnitDefinitions>");
    for (const std::string& unit : units)
      line("    <Unit name=\"{}\"/>", markup(unit));
    line("  </UnitDefinitions>");
  }

  std::string text_;
};

class Fmi2Description final : public Description {
 public:
  using Description::Description;

 private:
  void begin() override {
    line(R"(<fmiModelDescription fmiVersion="2.0" modelName="{}" guid="{}" generationTool="drivebench {}")",
         markup(bench_.name), fmi::token_of(bench_), drivebench_version());
    line(R"(    variableNamingConvention="flat" numberOfEventIndicators="0">)");
    line(R"(  <CoSimulation modelIdentifier="{}" canHandleVariableCommunicationStepSize="true")",
         fmi::identifier_of(bench_.name));
    line(R"(    canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>)");
  }

  void variable(std::size_t number, const Variable& v) override {
    const bool is_integer = v.type == Type::kInt32;
    line("    <ScalarVariable {}><{}{}/></ScalarVariable>", common(number, v),
         is_integer ? "Integer" : "Real", values(v, !is_integer));
  }

  void structure() override {
    for (const std::string_view list : {"Outputs", "InitialUnknowns"}) {
      line("    <{}>", list);
      for (std::size_t number = 0; number < variables_.size(); ++number) {
        // No output follows an input within the same instant. Their indices begin with 1.
        if (variables_[number].causality == Causality::kOutput)
          line("      <Unknown index=\"{}\" dependencies=\"\"/>", number + 1);
      }
      line("    </{}>", list);
    }
  }
};

class Fmi3Description final : public Description {
 public:
  using Description::Description;

 private:
  void begin() override {
    line(R"(<fmiModelDescription fmiVersion="3.0" modelName="{}" instantiationToken="{}")",
         markup(bench_.name), fmi::token_of(bench_));
    line(R"(    generationTool="drivebench {}" variableNamingConvention="flat">)", drivebench_version());
    line(R"(  <CoSimulation modelIdentifier="{}" canHandleVariableCommunicationStepSize="true")",
         fmi::identifier_of(bench_.name));
    line(R"(    fixedInternalStepSize="{}" canGetAndSetFMUState="true" canSerializeFMUState="true"/>)",
         shortest(bench_.period_s));
  }

  void variable(std::size_t number, const Variable& v) override {
    const std::string_view type = v.type == Type::kReal    ? "Float64"
                                  : v.type == Type::kInt32 ? "Int32"
                                  : v.type == Type::kInt64 ? "Int64"
                                                           : "UInt64";
    line("    <{} {}{}/>", type, common(number, v), values(v, v.type == Type::kReal));
  }

  void after_variables() override {
    line(
        R"(    <Float64 name="time" valueReference="{}" causality="independent" variability="continuous" unit="s"/>)",
        variables_.size());
  }

  void structure() override {
    for (const std::string_view element : {"Output", "InitialUnknown"}) {
      for (std::size_t number = 0; number < variables_.size(); ++number) {
        if (variables_[number].causality == Causality::kOutput)
          line("    <{} valueReference=\"{}\" dependencies=\"\"/>", element, number);
      }
    }
  }
};

}  // namespace

std::string model_description(const drivebench_description& bench, const std::vector<Variable>& variables,
                              Fmi version) {
  if (version == Fmi::k2) return Fmi2Description(bench, variables).text();
  return Fmi3Description(bench, variables).text();
}

}  // namespace drivebench::fmu
