#include "trainer/app/vectors_csv.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/app/evaluation_report.h"

namespace fdi::trainer {

VectorsCsv::VectorsCsv(std::filesystem::path path, const ModelSet& models)
    : path_(std::move(path)), part_(path_), models_(models) {
  part_ += ".part";
  out_.open(part_, std::ios::binary | std::ios::trunc);
  if (!out_) {
    throw DataError("cannot write " + part_.string() + ": " +
                    std::strerror(errno));
  }
  out_ << "run,stamp_ns,source_id,seq,intake,initialised,quality,state";
  for (const ChannelSpec& channel : models_.channels) {
    out_ << ",r_" << channel.name;
  }
  out_ << ",d_0";
  for (const int fault : models_.faults) {
    out_ << ",d_" << FaultName(fault);
  }
  out_ << ",isolated";
  for (const Observer& observer : models_.observers) {
    out_ << ",o_" << observer.name;
  }
  out_ << '\n';
}

VectorsCsv::~VectorsCsv() {
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void VectorsCsv::AddNumber(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), ",%a", value);
  out_ << text.data();
}

void VectorsCsv::Add(const std::string& run, const Verdict& verdict) {
  out_ << CsvCell(run) << ',' << verdict.stamp_ns << ',' << verdict.source_id
       << ',' << verdict.seq << ',' << IntakeName(verdict.intake) << ','
       << (verdict.initialised ? 1 : 0) << ',' << QualityName(verdict.quality)
       << ',' << StateName(verdict.state);
  for (std::size_t c = 0; c < models_.channels.size(); ++c) {
    AddNumber(verdict.residuals[c]);
  }
  AddNumber(verdict.normal_factor);
  for (std::size_t f = 0; f < models_.faults.size(); ++f) {
    AddNumber(verdict.fault_factors[f]);
  }
  out_ << ','
       << (verdict.isolated == 0 ? ""
                                 : FaultSetName(models_, verdict.isolated));
  for (std::size_t o = 0; o < models_.observers.size(); ++o) {
    AddNumber(verdict.observer_factors[o]);
  }
  out_ << '\n';
}

void VectorsCsv::Commit() {
  out_.close();
  if (!out_) {
    throw DataError("cannot write " + part_.string() + ": " +
                    std::strerror(errno));
  }
  std::filesystem::rename(part_, path_);
}

}  // namespace fdi::trainer
