#pragma once

#include "trainer/training.h"

/// The overridable settings by their names in TOML, with the accepted range:
/// `visit(name, field, minimum, maximum)`, or `visit(name, flag)`.
namespace fdi::trainer {

template <typename Visitor>
void VisitDecision(DecisionParameters& d, Visitor&& visit) {
  visit("isolation_threshold", d.isolation_threshold, 0.01, 0.99);
  visit("detection_samples", d.detection_samples, 1, 1000);
  visit("isolation_samples", d.isolation_samples, 1, 10000);
  visit("isolation_fraction", d.isolation_fraction, 0.01, 1.0);
  visit("join_fraction", d.join_fraction, 0.01, 1.0);
  visit("reisolation_samples", d.reisolation_samples, 1, 10000);
  visit("clearing_samples", d.clearing_samples, 1, 100000);
  visit("settling_samples", d.settling_samples, 0, 100000);
  visit("evidence_window", d.evidence_window, 2.0, 1e6);
  visit("evidence_core", d.evidence_core, 0.0, 1e6);
  visit("evidence_support", d.evidence_support, 1e-6, 1e6);
  visit("interpolation_allowance", d.interpolation_allowance, 0.0, 1.0);
  visit("early_error", d.early_error, 0.0, 0.1);
}

template <typename Visitor>
void VisitTraining(TrainingOptions& t, Visitor&& visit) {
  GustafsonKesselOptions& clustering = t.fit.rules.fit.clustering;
  visit("false_alarms_per_hour", t.false_alarms_per_hour, 1e-9, 3600.0);
  visit("validation_share", t.dataset.validation_share, 0.05, 0.95);
  visit("dropped_after_step", t.dataset.dropped_after_step, 0, 100000);
  visit("shortest_stretch", t.dataset.shortest_stretch, 10, 1000000);
  visit("assume_normal", t.dataset.assume_normal);
  visit("min_rules", t.fit.rules.min_rules, 1, kMaxRules);
  visit("max_rules", t.fit.rules.max_rules, 1, kMaxRules);
  visit("rule_tolerance", t.fit.rules.tolerance, 0.0, 10.0);
  visit("search_rules", t.fit.search_rules, 1, kMaxRules);
  visit("max_regressors", t.fit.structure.max_regressors, 1, kMaxRegressors);
  visit("relative_improvement", t.fit.structure.relative_improvement, 0.0, 1.0);
  visit("settling", t.fit.settling, 0, 100000);
  visit("fuzziness", clustering.fuzziness, 1.01, 10.0);
  visit("starts", clustering.num_starts, 1, 100);
  visit("clustering_seed", clustering.seed, 0, 1000000000);
}

}  // namespace fdi::trainer
