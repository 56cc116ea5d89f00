#include "diagnosis/model/valve_costs.h"

#include <algorithm>

#include "base/csv_cells.h"
#include "base/error.h"

namespace fdi {
namespace {

[[noreturn]] void Refuse(std::string_view figure, const std::string& reason) {
  throw ConfigError("costs " + Quoted(figure) + ": " + reason +
                    "; type figures such as \"12.5 EUR/t\" or \"12.5 EUR/m3\" "
                    "(the medium), \"4000 EUR/h\" (downtime), \"350 EUR\" (a "
                    "visit), separated by commas");
}

std::string_view Trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' ');
  return first == std::string_view::npos
             ? std::string_view{}
             : text.substr(first, text.find_last_not_of(' ') + 1 - first);
}

void AddFigure(std::string_view figure, ValveCosts& costs) {
  const std::size_t space = figure.find(' ');
  const auto amount = ParseNumber(figure.substr(0, space));
  if (!amount) {
    Refuse(figure, "it does not begin with an amount");
  }
  if (*amount < 0.0) {
    Refuse(figure, "an amount is not negative");
  }
  const std::string_view rest =
      space == std::string_view::npos ? "" : Trimmed(figure.substr(space));
  const std::size_t slash = rest.find('/');
  const std::string currency(Trimmed(rest.substr(0, slash)));
  if (currency.empty()) {
    Refuse(figure, "it has no currency");
  }
  if (!costs.currency.empty() && currency != costs.currency) {
    Refuse(figure, "another figure is in " + costs.currency);
  }
  costs.currency = currency;
  const std::string_view unit =
      slash == std::string_view::npos ? std::string_view{} : rest.substr(slash);
  const bool medium = unit == "/t" || unit == "/m3";
  if (!medium && unit != "/h" && !unit.empty()) {
    Refuse(figure, "its unit is none of /t, /m3 and /h");
  }
  std::optional<double>& place = medium         ? costs.medium
                                 : unit.empty() ? costs.visit
                                                : costs.downtime;
  if (place) {
    Refuse(figure, "there is another figure of the same kind");
  }
  place = amount;
  if (medium) {
    costs.flow = unit == "/t" ? FlowUnit::kTPerHour : FlowUnit::kM3PerHour;
  }
}

}  // namespace

ValveCosts ParseCosts(std::string_view text) {
  ValveCosts costs;
  // A cell of CSV may be separated by commas itself.
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(",;|"), text.size());
    AddFigure(Trimmed(text.substr(0, end)), costs);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return costs;
}

}  // namespace fdi
