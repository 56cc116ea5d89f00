#include "trainer/fleet/plant_rows.h"

namespace fdi::trainer {

using importer::LoopTag;

storage::PlantLoop LoopOf(const importer::PlantRow& row,
                          const ValveIdentity& before) {
  storage::PlantLoop loop;
  ValveIdentity& identity = loop;
  identity = static_cast<const ValveIdentity&>(row);
  identity.grade = identity.grade ? identity.grade : before.grade;
  for (const auto member :
       {&ValveIdentity::description, &ValveIdentity::location,
        &ValveIdentity::document, &ValveIdentity::costs}) {
    if ((identity.*member).empty()) {
      identity.*member = before.*member;
    }
  }
  loop.name = row.name;
  loop.type = row.type;
  loop.group = row.group;
  return loop;
}

storage::ValveEntry EntryOf(const importer::PlantRow& row) {
  storage::ValveEntry entry;
  entry.pattern = row.name;
  entry.type = row.type.empty() ? "data only" : row.type;
  entry.sense = row.sense;
  entry.signals = MaskOf(Signal::kCv);
  const auto add = [&](LoopTag tag, Signal signal) {
    if (!row[tag].pattern.empty()) {
      entry.signals = static_cast<SignalMask>(entry.signals | MaskOf(signal));
    }
  };
  add(LoopTag::kSp, Signal::kSp);
  add(LoopTag::kX, Signal::kX);
  add(row.FlowTag().value_or(LoopTag::kF), Signal::kF);
  add(LoopTag::kP1, Signal::kP1);
  add(LoopTag::kP2, Signal::kP2);
  add(LoopTag::kT1, Signal::kT1);
  return entry;
}

}  // namespace fdi::trainer
