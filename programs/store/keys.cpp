// fdi-store keys init, add, renew, list: the keys of a secured bus.
#include "idl/security/keys.h"

#include "base/error.h"
#include "base/time_units.h"
#include "programs/store/verbs.h"

namespace fdi::storage {
namespace {

constexpr int kAuthorityDays = 3650;
constexpr int kKeyDays = 365;

struct KeyOptions {
  std::string folder;
  std::string name;
  std::string role;
  std::string partitions;
  int days{kKeyDays};
};

// "days_left" counts from now.
Json KeyJson(const idl::KeyInfo& key) {
  return {
      {"name", key.name},
      {"role", idl::RoleName(key.role)},
      {"partitions", key.partitions},
      {"from_utc", TimeJson(key.from_ns)},
      {"until_utc", TimeJson(key.until_ns)},
      {"days_left", static_cast<double>(key.until_ns - NowNs()) / kNsPerDay}};
}

Report ShowKeys(Json keys) {
  Report report;
  report.document["keys"] = std::move(keys);
  report.Table("keys",
               {{"key", "name"},
                {"role", "role"},
                {"partitions", "partitions"},
                {"valid until", "until_utc", report::Format::kTime},
                {.heading = "days left",
                 .key = "days_left",
                 .decimals = 0,
                 .tone =
                     [](const Json& row) {
                       return row["days_left"].get<double>() <
                                      idl::kDaysOfWarning
                                  ? report::Tone::kWarning
                                  : report::Tone::kPlain;
                     }}},
               "no key yet: fdi-store keys add makes one");
  return report;
}

Report InitAuthority(const KeyOptions& options, const Context&) {
  idl::MakeAuthority(options.folder, options.days);
  Report report;
  report.document["folder"] = options.folder;
  report.Line(options.folder +
              ": an authority, no key yet. Keep ca.key where no monitor runs: "
              "who has it can make keys.");
  return report;
}

Report AddKey(const KeyOptions& options, const Context&) {
  const std::optional<idl::Role> role = idl::ParseRole(options.role);
  if (!role) {
    throw ConfigError("--role is '" + options.role + "', accepted are " +
                      idl::kRoleNames);
  }
  return ShowKeys(Json::array(
      {KeyJson(idl::MakeKey(options.folder, options.name, *role, options.days,
                            false, options.partitions))}));
}

Report Renew(const KeyOptions& options, const Context&) {
  return ShowKeys(Json::array(
      {KeyJson(idl::RenewKey(options.folder, options.name, options.days))}));
}

Report ListKeys(const KeyOptions& options, const Context&) {
  return ShowKeys(Rows(idl::ListKeys(options.folder), KeyJson));
}

void AddFolder(CLI::App& verb, KeyOptions& options) {
  verb.add_option("folder", options.folder, "Folder of the authority")
      ->type_name("DIR")
      ->required();
}

void AddName(CLI::App& verb, KeyOptions& options) {
  verb.add_option("name", options.name,
                  "Of the program or host; also the name of its folder")
      ->required();
}

void AddDaysOption(CLI::App& verb, KeyOptions& options) {
  verb.add_option("--days", options.days, "How long it is valid")
      ->capture_default_str();
}

}  // namespace

void AddKeysVerbs(report::Program& program) {
  CLI::App& group = program.AddGroup(
      "keys", "Keys of DDS Security, for --security of the other programs");
  {
    auto [verb, options] =
        AddVerb(program, group, "init", "Create an authority, which signs keys",
                InitAuthority);
    options.days = kAuthorityDays;
    AddFolder(verb, options);
    AddDaysOption(verb, options);
  }
  {
    auto [verb, options] = AddVerb(
        program, group, "add", "Create a key for a program or host", AddKey);
    AddFolder(verb, options);
    AddName(verb, options);
    verb.add_option("--role", options.role,
                    "gateway (publishes samples), monitor, or reader (of all "
                    "topics)")
        ->required();
    verb.add_option("--partition", options.partitions,
                    "Where a gateway may publish (default: anywhere)")
        ->type_name("NAME[,NAME]");
    AddDaysOption(verb, options);
  }
  {
    auto [verb, options] =
        AddVerb(program, group, "renew",
                "Replace a key by a new one with the same rights", Renew);
    AddFolder(verb, options);
    AddName(verb, options);
    AddDaysOption(verb, options);
  }
  {
    auto [verb, options] =
        AddVerb(program, group, "list", "The keys and how long they are valid",
                ListKeys);
    AddFolder(verb, options);
  }
}

}  // namespace fdi::storage
