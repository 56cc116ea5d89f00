#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "gateway/duties.h"
#include "gateway/live_table.h"
#include "gateway/reading_source.h"
#include "gateway/valve_wire.h"
#include "import/assembler.h"
#include "report/program.h"

namespace fdi::gateway {

struct IntakeOptions {
  std::filesystem::path plant;
  bool by_topics{false};  ///< As ReadLiveTable().
  bool by_group{false};
  std::int64_t lateness_ns{2'000'000'000};
};

/// From readings to samples on the bus: table, assembler, wire, and what is to
/// be said of them. One thread.
class Intake {
 public:
  /// @throws as ReadLiveTable() and ValveWire; ConfigError if no row is usable.
  Intake(const IntakeOptions& options, ReadingSource& source,
         const report::Context& context, report::StopSignals& signals);

  /// Follows the source until it ends or a stop is requested; reads the table
  /// again when a reload is.
  void Run(Duties& duties);

  /// Totals, for a report at the end.
  report::Json Summary() const;

 private:
  void Use();
  void Reload();
  void Take(const importer::TagReading& reading);
  void Say(const importer::AssemblyNote& note);
  std::vector<Metric> Metrics() const;
  std::string TagsPage() const;
  ReadingHandlers Handlers();
  importer::Assembler::Sink Sink();

  IntakeOptions options_;
  ReadingSource& source_;
  const report::Context& context_;
  report::StopSignals& signals_;
  CalmLog calm_;
  LiveTable table_;
  importer::Assembler assembler_;
  ValveWire wire_;
  struct Totals {
    std::uint64_t readings{0};
    std::uint64_t bad{0};  // Without a usable value or stamp.
    std::uint64_t late{0};
    std::uint64_t unknown{0};  // With a tag that no row has.
    std::uint64_t wrong{0};    // Lines and payloads that say nothing.
  } totals_;
};

}  // namespace fdi::gateway
