#include <iostream>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/leave_one_out.h"
#include "trainer/model_reduction.h"

namespace fdi::trainer {
namespace {

std::vector<LeftOutFault> LeaveEachOut(const ModelSet& models,
                                       std::vector<ScoredRun> runs,
                                       const EvaluateOptions& options) {
  std::map<int, std::vector<ScoredRun>> by_fault;
  for (ScoredRun& scored : runs) {
    const int fault = FaultOf(scored.run);
    if (fault != 0) {
      by_fault[fault].push_back(std::move(scored));
    }
  }
  std::vector<LeftOutFault> result;
  for (const auto& [fault, its_runs] : by_fault) {
    const bool known = FaultIndex(models, fault) >= 0;
    const auto reduced = std::make_shared<const ModelSet>(
        known ? WithoutFaults(models, {fault}) : models);
    result.push_back(
        CountLeftOut(fault, GroupOf(fault, models.groups),
                     ScoreRuns(reduced, its_runs, options.assume_normal)));
  }
  return result;
}

std::string NamedText(const LeftOutFault& left_out) {
  std::string text;
  for (const auto& [set, count] : left_out.named) {
    text.append(text.empty() ? "" : ", ").append(SetText(set));
    if (count > 1) {
      text.append(" x").append(std::to_string(count));
    }
  }
  return text;
}

cli::Json JsonOf(const LeftOutFault& left_out) {
  cli::Json json;
  if (left_out.fault != 0) {
    json["fault"] = FaultName(left_out.fault);
  }
  json["runs"] = left_out.runs;
  json["detected"] = left_out.detected;
  json["unknown"] = left_out.unknown;
  json["wrongly_named"] = left_out.wrongly_named;
  json["as_look_alike"] = left_out.as_look_alike;
  if (left_out.fault != 0) {
    json["named"] = cli::Json::object();
    for (const auto& [set, count] : left_out.named) {
      json["named"][SetText(set)] = count;
    }
  }
  return json;
}

void Print(std::ostream& out, const std::vector<LeftOutFault>& faults) {
  using cli::Align;
  cli::TextTable table({{"left out"},
                        {"runs", Align::kRight},
                        {"detected", Align::kRight},
                        {"unknown", Align::kRight},
                        {"wrongly named", Align::kRight},
                        {"look-alike of its group", Align::kRight},
                        {"named"}});
  const auto add = [&](const std::string& name, const LeftOutFault& f) {
    table.AddRow({name, std::to_string(f.runs), std::to_string(f.detected),
                  std::to_string(f.unknown), std::to_string(f.wrongly_named),
                  std::to_string(f.as_look_alike), NamedText(f)});
  };
  for (const LeftOutFault& left_out : faults) {
    add(FaultName(left_out.fault), left_out);
  }
  add("total", SumOf(faults));
  table.Print(out);
}

}  // namespace

int EvaluateLeaveOneOut(const EvaluateOptions& options,
                        const cli::Context& context) {
  const auto models = LoadModels(options, context);
  const std::vector<LeftOutFault> faults = LeaveEachOut(
      *models,
      LoadScoredRuns(options.selection, RequiredSignals(*models), context),
      options);
  if (!context.options.json) {
    Print(std::cout, faults);
    return cli::kExitOk;
  }
  cli::Json json = DetectorJson(DetectorOf(*models));
  json["left_out"] = cli::Json::array();
  for (const LeftOutFault& left_out : faults) {
    json["left_out"].push_back(JsonOf(left_out));
  }
  json["total"] = JsonOf(SumOf(faults));
  cli::PrintJson(std::cout, json);
  return cli::kExitOk;
}

}  // namespace fdi::trainer
