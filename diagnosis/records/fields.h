#pragma once

#include <functional>
#include <string_view>
#include <tuple>

namespace fdi {

/// A field of a record with its name in SQL, JSON and on the wire. `member` is
/// a pointer to member.
template <typename Member>
struct Field {
  std::string_view name;
  Member member;

  template <typename Record>
  auto& operator()(Record& record) const {
    return std::invoke(member, record);
  }
};
template <typename Member>
Field(const char*, Member) -> Field<Member>;  // For clang 14.
template <typename Member>
constexpr Field<Member> FieldOf(std::string_view name, Member member) {
  return {name, member};
}

/// The fields of a flat record in storage order: a tuple of Field, specialised
/// beside the record. There is no other list of them.
template <typename Record>
inline constexpr std::tuple<> kFieldsOf{};

}  // namespace fdi

/// FDI_FIELDS(fdi::DataGap, valve_id, from_ns, to_ns, reason), used outside all
/// namespaces, defines kFieldsOf<DataGap> with members of these names, 64 at
/// most. The macros below apply a macro to every argument after the first.
#define FDI_FIELDS(Record, ...)                  \
  template <>                                    \
  inline constexpr auto fdi::kFieldsOf<Record> = \
      std::tuple{FDI_EXPAND(FDI_EACH(Record, __VA_ARGS__))};
#define FDI_FIELD(Record, name) fdi::FieldOf(#name, &Record::name)
#define FDI_EACH(Record, name, ...) \
  FDI_FIELD(Record, name)           \
  __VA_OPT__(, FDI_AGAIN FDI_NONE()()(Record, __VA_ARGS__))
#define FDI_AGAIN() FDI_EACH
#define FDI_NONE()
#define FDI_EXPAND(...) \
  FDI_EXPAND3(FDI_EXPAND3(FDI_EXPAND3(FDI_EXPAND3(FDI_EXPAND3(__VA_ARGS__)))))
#define FDI_EXPAND3(...) FDI_EXPAND2(FDI_EXPAND2(FDI_EXPAND2(__VA_ARGS__)))
#define FDI_EXPAND2(...) FDI_EXPAND1(FDI_EXPAND1(FDI_EXPAND1(__VA_ARGS__)))
#define FDI_EXPAND1(...) __VA_ARGS__
