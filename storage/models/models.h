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

#include "diagnosis/model_set.h"
#include "diagnosis/sample_series.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Schema of models.db: tables model_set, observer, channel, training_run,
/// valve, valve_event, baseline, valve_type, lineage, training_episode,
/// generation and the view model_summary; see docs/data.md.
const Schema& ModelsSchema();

/// `NAME`, which means its active version, or `NAME@VERSION`.
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

/// An episode of history.db that a model set learnt from: what it was labelled,
/// what that was taken to mean, and where its samples are.
struct TrainingEpisode {
  std::string episode_id;  ///< 16 hex digits.
  std::string valve_id;
  std::string label;  ///< true, false, or a fault.
  std::string labelled_by;
  std::int64_t labelled_ns{0};
  int fault{0};          ///< 0: normal operation.
  double strength{0.0};  ///< Signed; 0 in normal operation.
  std::string run;       ///< Of runs.db, among the training runs of the set.
  std::int64_t samples{0};

  bool operator==(const TrainingEpisode&) const = default;
};

/// The model set that another one was built on.
struct ParentSet {
  std::string name;
  int version{0};
  std::uint64_t content_hash{0};

  bool operator==(const ParentSet&) const = default;
};

/// Where a model set comes from, beside its training runs. Stays in models.db:
/// an exported file does not carry it.
struct Lineage {
  std::string settings;  ///< JSON of the training; empty: not known.
  std::optional<ParentSet> parent;
  std::vector<TrainingEpisode> episodes;  ///< Those of the parent, too.
};

/// Whether the models of a valve were made for the valve as it is now.
enum class BaselineState : std::uint8_t {
  kNone,         ///< Not onboarded: the models are the user's business.
  kProvisional,  ///< Onboarded in an earlier epoch: isolation is held.
  kValid,        ///< Onboarded in this epoch.
};
std::string_view BaselineStateName(BaselineState state);  ///< "none", ...

/// How a normal model fits the healthy valve.
struct ChannelFigures {
  std::string name;
  double rmse{0.0};  ///< [unit of the output]
  double bias{0.0};  ///< Mean residual [unit of the output].
  double vaf{0.0};   ///< [%]
};

/// What onboarding found of a valve in one epoch: the valve as it was found
/// and as it was left, side by side.
struct BaselineRecord {
  std::uint32_t epoch{0};
  std::string model_set;
  int version{0};
  double hours{0.0};  ///< Of healthy data.
  /// Fitted, by name, e.g. {"trim.kv_m3_h", 118.2}.
  std::vector<std::pair<std::string, double>> parameters{};
  std::vector<ChannelFigures> channels{};
  std::int64_t created_ns{0};  ///< UTC; filled when it is stored.
};

enum class ValveEventKind : std::uint8_t {
  kReplaced,
  kRepacked,
  kRecalibrated
};
std::string_view ValveEventKindName(ValveEventKind kind);  ///< "replaced", ...
/// @throws ConfigError naming the accepted names.
ValveEventKind ParseValveEventKind(std::string_view name);

/// What was done to a valve; it opens an epoch.
struct ValveEvent {
  std::uint32_t epoch{0};  ///< That it opened; filled when it is stored.
  ValveEventKind kind{ValveEventKind::kReplaced};
  std::string note{};
  std::int64_t at_ns{0};  ///< UTC.
  std::string who{};
};

/// The effects of the faults on a type of valve, apart from any valve's
/// baseline. The bytes are the trainer's.
struct ValveType {
  std::string name;
  std::int64_t created_ns{0};  ///< UTC; filled when it is stored.
  std::string summary{};       ///< One line for people.
  std::size_t size{0};         ///< Of `bytes`, which lists leave empty.
  std::vector<std::byte> bytes{};
};

/// What is known about a valve, or about all whose id matches a glob.
struct ValveEntry {
  std::string pattern;  ///< Id, or glob with * ? [...].
  std::string type;     ///< Free text, e.g. "globe DN100".
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  Sense sense{Sense::kClosing};
  SignalMask signals{kBasicSignals};
  double period_s{1.0};
  std::uint32_t epoch{0};  ///< Replacements and recalibrations.
  std::optional<ModelReference> model_set;
  /// In which the assigned set was made by onboarding; see BaselineState.
  std::optional<std::uint32_t> baseline_epoch;

  BaselineState baseline() const {
    if (!baseline_epoch) {
      return BaselineState::kNone;
    }
    return *baseline_epoch == epoch ? BaselineState::kValid
                                    : BaselineState::kProvisional;
  }
};

/// Whether a version that is stored becomes the active one of its name.
enum class Activation {
  kIfFirst,  ///< Only if no version of that name is active.
  kAlways,
};

/// Model sets and valves. Any number of readers; for changes open it as an
/// occasional writer. One thread at a time.
class ModelStore {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit ModelStore(const std::filesystem::path& path,
                      Access access = Access::kReader);

  /// Stores the set as the next version of its name, in one transaction.
  /// @returns it as Load() gives it: with version and content_hash.
  ModelSet Save(const ModelSet& models,
                Activation activation = Activation::kIfFirst,
                const Lineage& lineage = {});

  /// Where the set comes from; empty if that is not known.
  Lineage LineageOf(const ModelReference& reference);

  /// "NAME" (the active version) or "NAME@VERSION".
  /// @throws NotFoundError naming what is there.
  /// @throws DataError if the stored bytes are damaged.
  ModelSet Load(std::string_view reference);
  ModelSet Load(const ModelReference& reference);

  /// By name and version.
  std::vector<ModelSummary> List();
  ModelSummary Summary(const ModelReference& reference);
  /// The version answers from now on; without one, the newest.
  void Activate(const ModelReference& reference);

  /// Writes the canonical bytes to a file that does not exist yet.
  void ExportFile(const ModelReference& reference,
                  const std::filesystem::path& path);
  /// Stores a file as the next version of its name. @throws DataError
  ModelSet ImportFile(const std::filesystem::path& path,
                      Activation activation = Activation::kIfFirst);

  /// Valve entries in the order in which they are tried.
  std::vector<ValveEntry> Valves();
  /// Adds an entry behind the others, or replaces the one of that pattern.
  void PutValve(const ValveEntry& entry);
  /// @throws NotFoundError if there is no entry of that pattern.
  void RemoveValve(std::string_view pattern);
  /// Assigns a model set, or none, to the entry of `pattern`; adds the entry
  /// if it is not there. Another set than before has no baseline.
  /// @throws NotFoundError if there is no such model set.
  void AssignModelSet(std::string_view pattern,
                      const std::optional<ModelReference>& reference);

  /// The valve was onboarded in its present epoch: keeps `record`, assigns its
  /// model set, and the baseline is valid. Adds the entry if it is not there.
  /// @throws NotFoundError if there is no such model set; ConfigError if the
  ///   epoch is not the valve's.
  void SetBaseline(std::string_view pattern, const BaselineRecord& record);
  /// By epoch, then time.
  std::vector<BaselineRecord> Baselines(std::string_view pattern);

  /// Opens the next epoch; a baseline is provisional from now on.
  /// @returns the entry as it is now. @throws NotFoundError if there is none.
  ValveEntry AddValveEvent(std::string_view pattern, const ValveEvent& event);
  std::vector<ValveEvent> ValveEvents(std::string_view pattern);

  /// Keeps a valve type, in place of one of that name. @throws ConfigError if
  /// the name is not one of a model set.
  void SaveTemplate(const std::string& name, std::span<const std::byte> bytes,
                    const std::string& summary);
  /// @throws NotFoundError naming what is there.
  ValveType LoadTemplate(std::string_view name);
  /// By name, without bytes.
  std::vector<ValveType> ListTemplates();
  /// @throws NotFoundError
  void DeleteTemplate(std::string_view name);

  /// The first entry whose pattern matches.
  std::optional<ValveEntry> FindValve(std::string_view valve_id);

  /// Which version diagnoses the valve: the set of the first matching entry
  /// that names one (its active version unless it names one), else the active
  /// set whose name is the valve's id, else none: the valve is UNASSIGNED.
  std::optional<ModelReference> AssignedModelSet(std::string_view valve_id);

  /// Takes over from `other` what it knows of a valve: the model set that
  /// diagnoses it, and as its own entry the one that matches, with baselines
  /// and events. Twice is once.
  /// @param in_use content hash of the set that counts if none is assigned.
  /// @returns the set here; nothing if there is none.
  /// @throws ConfigError if an entry of a glob stands first and gives the valve
  ///   another set.
  std::optional<ModelReference> TakeValve(ModelStore& other,
                                          const std::string& valve_id,
                                          std::optional<std::uint64_t> in_use);

  /// Counts changes of active sets, assignments and valve entries.
  std::int64_t Generation();

  Database& database() { return database_; }

 private:
  std::int64_t RequireId(const ModelReference& reference);
  void BumpGeneration();
  ValveEntry RequireEntry(std::string_view pattern);
  /// The entry of `pattern`, or one for valves as the model set needs them.
  ValveEntry EntryOrNew(std::string_view pattern,
                        const std::optional<ModelReference>& reference);
  /// Within a transaction.
  void StoreEntry(const ValveEntry& entry);
  std::optional<ModelReference> FindContent(std::uint64_t hash);
  ModelReference TakeModelSet(ModelStore& other,
                              const ModelReference& reference);

  Database database_;
};

/// Tells cheaply whether assignments may have changed, for a service that
/// polls: most calls cost one look into shared memory.
class ChangeCounter {
 public:
  explicit ChangeCounter(const std::filesystem::path& path);

  /// True if active sets or valve entries changed since the last call (or
  /// since the construction).
  bool Changed();

 private:
  ModelStore store_;
  std::int64_t data_version_;
  std::int64_t generation_;
};

}  // namespace fdi::storage
