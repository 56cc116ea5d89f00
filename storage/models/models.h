#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample_series.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Schema of models.db: tables model_set, observer, channel, training_run,
/// valve, valve_event, baseline, valve_type, lineage, training_episode,
/// plant_loop, generation and the view model_summary; see docs/data.md.
const Schema& ModelsSchema();

/// `NAME`, meaning its active version, or `NAME@VERSION`.
struct ModelReference {
  std::string name;
  std::optional<int> version;

  bool operator==(const ModelReference&) const = default;
};

/// @throws ConfigError naming the accepted forms.
ModelReference ParseModelReference(std::string_view text);
std::string ToString(const ModelReference& reference);

/// A stored model set without its models.
struct ModelSummary {
  std::string name;
  int version{0};
  std::uint64_t content_hash{0};
  std::int64_t created_ns{0};
  bool active{false};
  std::string preset;
  std::string software;
  double period_s{1.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  int observers{0};
  int training_runs{0};
  std::int64_t bytes{0};
  double lowest_vaf{0.0};     ///< Over all channels of all observers [%].
  double greatest_mse{0.0};   ///< [unit²]
  double greatest_bias{0.0};  ///< |mean residual| [unit].
};

/// An episode of history.db used for training a model set: its label, how the
/// label was interpreted, and where its samples are.
struct TrainingEpisode {
  std::string episode_id;  ///< 16 hex digits.
  std::string valve_id;
  std::string label;  ///< true, false, or a fault.
  std::string labelled_by;
  std::int64_t labelled_ns{0};
  int fault{0};          ///< 0: normal operation.
  double strength{0.0};  ///< Signed; 0 in normal operation.
  std::string run;       ///< In runs.db, among the training runs of the set.
  std::int64_t samples{0};

  bool operator==(const TrainingEpisode&) const = default;
};

/// The model set from which another one was trained.
struct ParentSet {
  std::string name;
  int version{0};
  std::uint64_t content_hash{0};

  bool operator==(const ParentSet&) const = default;
};

/// The origin of a model set beside its training runs. Kept in models.db only:
/// exported files do not contain it.
struct Lineage {
  std::string settings;  ///< JSON of the training; empty: unknown.
  std::optional<ParentSet> parent;
  std::vector<TrainingEpisode> episodes;  ///< Including those of the parent.
};

/// Tells if the models of a valve match its current epoch.
enum class BaselineState : std::uint8_t {
  kNone,         ///< Not onboarded: the user is responsible.
  kProvisional,  ///< Onboarded in an earlier epoch: not isolated.
  kValid,        ///< Onboarded in this epoch.
};
std::string_view BaselineStateName(BaselineState state);  ///< "none", ...

/// Fit of a normal model on the healthy valve.
struct ChannelFigures {
  std::string name;
  double rmse{0.0};  ///< [unit of the output]
  double bias{0.0};  ///< Mean residual [unit of the output].
  double vaf{0.0};   ///< [%]
};

/// Result of onboarding a valve in one epoch: compares the valve as found and
/// as left.
struct BaselineRecord {
  std::uint32_t epoch{0};
  std::string model_set;
  int version{0};
  double hours{0.0};  ///< Healthy data used.
  /// Fitted parameters by name, e.g. {"trim.kv_m3_h", 118.2}.
  std::vector<std::pair<std::string, double>> parameters{};
  std::vector<ChannelFigures> channels{};
  std::int64_t created_ns{0};  ///< UTC; set by the store.
};

enum class ValveEventKind : std::uint8_t {
  kReplaced,
  kRepacked,
  kRecalibrated,
  kOrdered  ///< In work: nothing is done yet.
};
std::string_view ValveEventKindName(ValveEventKind kind);  ///< "replaced", ...
/// @throws ConfigError naming the accepted names.
ValveEventKind ParseValveEventKind(std::string_view name);

/// Maintenance of a valve.
struct ValveEvent {
  std::uint32_t epoch{0};  ///< Valve's epoch from then on; set by the store.
  ValveEventKind kind{ValveEventKind::kReplaced};
  std::string note{};
  std::int64_t at_ns{0};  ///< UTC.
  std::string who{};
  /// Only for kOrdered: the number of the order, and when the valve is to be
  /// back.
  std::string order{};
  std::optional<std::int64_t> expected_ns{};
};

/// The effects of faults on a type of valve, independent of any valve's
/// baseline. The bytes are defined by the trainer.
struct ValveType {
  std::string name;
  std::int64_t created_ns{0};  ///< UTC; set by the store.
  std::string summary{};       ///< One line of text.
  std::size_t size{0};         ///< Size of `bytes`, which lists omit.
  std::vector<std::byte> bytes{};
};

/// Configuration of a valve, or of all valves whose ids match a glob.
struct ValveEntry {
  std::string pattern;  ///< Id, or glob with * ? [...].
  std::string type;     ///< Free text, e.g. "globe DN100".
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  Sense sense{Sense::kClosing};
  SignalMask signals{kBasicSignals};
  double period_s{1.0};
  std::uint32_t epoch{0};  ///< Number of replacements and recalibrations.
  std::optional<ModelReference> model_set;
  /// Epoch in which onboarding made the assigned set; see BaselineState.
  std::optional<std::uint32_t> baseline_epoch;

  BaselineState baseline() const {
    if (!baseline_epoch) {
      return BaselineState::kNone;
    }
    return *baseline_epoch == epoch ? BaselineState::kValid
                                    : BaselineState::kProvisional;
  }
};

/// Tells if a stored version becomes the active one of its name.
enum class Activation {
  kIfFirst,  ///< Only if no version of that name is active.
  kAlways,
};

struct PlantLoop;    // plant_loops.h
struct ValveResult;  // plant_loops.h

/// Model sets and valves. Any number of readers; open it as an occasional
/// writer for changes. One thread at a time.
class ModelStore {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit ModelStore(const std::filesystem::path& path,
                      Access access = Access::kReader);

  /// Stores the set as the next version of its name, in one transaction.
  /// @returns the set as Load() would: with version and content_hash.
  ModelSet Save(const ModelSet& models,
                Activation activation = Activation::kIfFirst,
                const Lineage& lineage = {});

  /// The origin of a set; empty if unknown.
  /// @throws DataError naming a fault that this program does not know.
  Lineage LineageOf(const ModelReference& reference);

  /// Loads "NAME" (the active version) or "NAME@VERSION".
  /// @throws NotFoundError naming what exists.
  /// @throws DataError if the stored bytes are damaged.
  ModelSet Load(std::string_view reference);
  ModelSet Load(const ModelReference& reference);

  /// Ordered by name and version.
  std::vector<ModelSummary> List();
  ModelSummary Summary(const ModelReference& reference);
  /// Makes the version, or else the newest one, the active one of its name.
  /// Valves onboarded with a version of that name get it; assignments of a
  /// version by a person stay.
  void Activate(const ModelReference& reference);

  /// Writes the canonical bytes to a file that does not exist yet.
  void ExportFile(const ModelReference& reference,
                  const std::filesystem::path& path);
  /// Stores a file as the next version of its name. @throws DataError
  ModelSet ImportFile(const std::filesystem::path& path,
                      Activation activation = Activation::kIfFirst);

  /// Valve entries in matching order.
  std::vector<ValveEntry> Valves();
  /// Appends an entry, or replaces the one with that pattern.
  void PutValve(const ValveEntry& entry);
  /// Its loop goes, too. @throws NotFoundError if there is neither.
  void RemoveValve(std::string_view pattern);
  /// Assigns a model set, or none, to the entry with `pattern`, which is added
  /// if it does not exist. A different set has no baseline.
  /// @throws NotFoundError if there is no such model set.
  void AssignModelSet(std::string_view pattern,
                      const std::optional<ModelReference>& reference);

  /// Stores an onboarding in the valve's current epoch: adds `record`, assigns
  /// its model set and makes the baseline valid. Adds the entry if it does not
  /// exist.
  /// @throws NotFoundError if there is no such model set; ConfigError if the
  ///   epoch is not the current one.
  void SetBaseline(std::string_view pattern, const BaselineRecord& record);
  /// Ordered by epoch, then time.
  std::vector<BaselineRecord> Baselines(std::string_view pattern);

  /// Notes maintenance of a valve, with or without an entry. An order
  /// changes nothing until something else is noted. A replacement
  /// opens the next epoch of an entry, which makes its baseline provisional;
  /// after the others the valve is again what its models were made for.
  /// @returns the entry after the change, if there is one.
  std::optional<ValveEntry> AddValveEvent(std::string_view pattern,
                                          const ValveEvent& event);
  std::vector<ValveEvent> ValveEvents(std::string_view pattern);
  /// The repairs noted of all valves, with the id or glob, by time.
  std::vector<std::pair<std::string, ValveEvent>> Repairs();

  /// Stores a valve type, replacing one of the same name. @throws ConfigError
  /// if the name is not valid for a model set.
  void SaveTemplate(const std::string& name, std::span<const std::byte> bytes,
                    const std::string& summary);
  /// @throws NotFoundError naming what exists.
  ValveType LoadTemplate(std::string_view name);
  /// Ordered by name, without bytes.
  std::vector<ValveType> ListTemplates();

  /// The first entry whose pattern matches.
  std::optional<ValveEntry> FindValve(std::string_view valve_id);

  /// The model set of a valve: that of the first matching entry which names one
  /// (its active version unless a version is given), else the active set whose
  /// name is the valve's id, else none, and the valve is UNASSIGNED.
  std::optional<ModelReference> AssignedModelSet(std::string_view valve_id);

  /// Copies from `other` what belongs to a valve: its model set and, as an
  /// entry of its own, the matching entry with baselines and events.
  /// Idempotent.
  /// @param in_use content hash of the set to use if none is assigned.
  /// @returns the set in this store; nothing if there is none.
  /// @throws ConfigError if a glob entry in front of it assigns another set.
  std::optional<ModelReference> TakeValve(ModelStore& other,
                                          const std::string& valve_id,
                                          std::optional<std::uint64_t> in_use);

  /// Stores a model set, valve entry, baseline, type and loop in one
  /// transaction. @returns the set as Save() would.
  std::optional<ModelSet> Store(const ValveResult& result);
  /// Adds a loop or replaces the one of that name, with `entry` for its valve
  /// unless it has one; without a pattern it gets none.
  void PutLoop(const PlantLoop& loop, const ValveEntry& entry);
  /// The loops of the plant by name.
  std::vector<PlantLoop> Loops();
  /// Copies the loops of `other` with their valves, as TakeValve() does, and
  /// its valve types that are not here. Idempotent. @returns how many loops.
  std::size_t TakeLoops(ModelStore& other);

  /// Incremented by changes of active sets, assignments and valve entries.
  std::int64_t Generation();

  Database& database() { return database_; }

 private:
  std::int64_t RequireId(const ModelReference& reference);
  void BumpGeneration();
  /// Call within a transaction or a snapshot.
  ModelSummary ReadSummaryOf(const ModelReference& reference);
  ValveEntry RequireEntry(std::string_view pattern);
  bool IsEntry(std::string_view pattern);
  /// The entry of `pattern`, or a new one with the model set's requirements.
  ValveEntry EntryOrNew(std::string_view pattern,
                        const std::optional<ModelReference>& reference);
  /// Call these within a transaction.
  void StoreEntry(const ValveEntry& entry);
  void StoreLoop(const PlantLoop& loop);
  void StoreBaseline(std::string_view pattern, const BaselineRecord& record);
  void StoreType(const ValveType& type);
  ModelSet Insert(const ModelSet& models, Activation activation,
                  const Lineage& lineage);
  std::optional<ModelReference> FindContent(std::uint64_t hash);
  ModelReference TakeModelSet(ModelStore& other,
                              const ModelReference& reference);

  Database database_;
};

/// Cheap check for changed assignments, for a service that polls: most calls
/// cost one look into shared memory.
class ChangeCounter {
 public:
  explicit ChangeCounter(const std::filesystem::path& path);

  /// True if active sets or valve entries changed since the last call, or since
  /// construction.
  bool Changed();

 private:
  ModelStore store_;
  std::int64_t data_version_;
  std::int64_t generation_;
};

}  // namespace fdi::storage
