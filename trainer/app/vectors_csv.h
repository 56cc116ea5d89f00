#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "diagnosis/model_set.h"
#include "diagnosis/verdict.h"

namespace fdi::trainer {

/// The file of `evaluate --vectors`: one line per sample with what the engine
/// said, numbers as hex floats (%a), so that lines of equal bits are equal.
/// Columns: run, stamp_ns, source_id, seq, intake, initialised, quality, state,
/// r_CHANNEL, d_0, d_FAULT, isolated (f3|f6), o_OBSERVER.
///
/// Written beside its name first, so that a failure leaves no part of it.
class VectorsCsv {
 public:
  /// @throws DataError naming the file if it cannot be written.
  VectorsCsv(std::filesystem::path path, const ModelSet& models);
  ~VectorsCsv();
  VectorsCsv(const VectorsCsv&) = delete;
  VectorsCsv& operator=(const VectorsCsv&) = delete;

  void Add(const std::string& run, const Verdict& verdict);
  /// Gives the file its name. @throws DataError
  void Commit();

 private:
  void AddNumber(double value);

  std::filesystem::path path_;
  std::filesystem::path part_;
  const ModelSet& models_;
  std::ofstream out_;
};

}  // namespace fdi::trainer
