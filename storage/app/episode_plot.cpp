#include "storage/app/episode_plot.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "diagnosis/error.h"

extern char** environ;

namespace fdi::storage {
namespace {

// Columns of the data block, from 1: t, CV, X, F, x̂, f̂, residuals, factors.
constexpr int kFirstResidual = 7;

double SecondsFrom(std::int64_t stamp_ns, std::int64_t origin_ns) {
  return static_cast<double>(stamp_ns - origin_ns) * 1e-9;
}

std::string Number(double value) {
  if (!std::isfinite(value)) {
    return "NaN";
  }
  std::ostringstream text;
  text.precision(9);
  text << value;
  return text.str();
}

std::string Reading(const Sample& sample, Signal signal) {
  return sample.Has(signal) ? Number(sample[signal]) : "NaN";
}

// ŷ = y − r of the normal observer for the channel that watches `signal`.
std::string Estimate(const Episode& episode, const TraceInstant& instant,
                     Signal signal) {
  for (std::size_t c = 0; c < episode.channels.size(); ++c) {
    if (episode.channels[c] == SignalName(signal) &&
        instant.received.sample.Has(signal)) {
      return Number(instant.received.sample[signal] - instant.residuals[c]);
    }
  }
  return "NaN";
}

bool IsDrawn(const Episode& episode, const TraceInstant& instant,
             const PlotOptions& options) {
  const double t_s =
      SecondsFrom(instant.received.sample.stamp_ns, episode.detected_ns);
  return instant.received.intake == Intake::kAccepted &&
         t_s >= options.from_s && t_s <= options.to_s;
}

void WriteData(const Episode& episode, const std::vector<TraceInstant>& trace,
               std::ostream& out) {
  out << "$data << EOD\n";
  for (const TraceInstant& instant : trace) {
    const Sample& sample = instant.received.sample;
    out << Number(SecondsFrom(sample.stamp_ns, episode.detected_ns));
    for (const Signal signal : {Signal::kCv, Signal::kX, Signal::kF}) {
      out << ' ' << Reading(sample, signal);
    }
    out << ' ' << Estimate(episode, instant, Signal::kX) << ' '
        << Estimate(episode, instant, Signal::kF);
    for (const double residual : instant.residuals) {
      out << ' ' << Number(residual);
    }
    out << ' ' << Number(instant.normal_factor);
    for (const double factor : instant.fault_factors) {
      out << ' ' << Number(factor);
    }
    out << '\n';
  }
  out << "EOD\n";
}

// gnuplot text in single quotes.
std::string Quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) {
    result += c == '\'' ? "''" : std::string(1, c);
  }
  return result + "'";
}

void WriteMarks(const Episode& episode, std::ostream& out) {
  out << "set arrow 1 from first 0, graph 0 to first 0, graph 1 nohead lc rgb "
         "'#d62728' dt 2\n";
  if (episode.isolated_ns) {
    const std::string t =
        Number(SecondsFrom(*episode.isolated_ns, episode.detected_ns));
    out << "set arrow 2 from first " << t << ", graph 0 to first " << t
        << ", graph 1 nohead lc rgb '#1f77b4' dt 2\n";
  }
}

std::string Title(const Episode& episode) {
  return episode.valve_id + ": " + episode.fault.value_or("not isolated") +
         ", detected " + episode.detected_utc + ", " + episode.model_set +
         ", episode " + episode.episode_id;
}

void WritePanels(const Episode& episode, std::ostream& out) {
  const std::string unit(FlowUnitName(episode.flow_unit));
  out << "set multiplot layout 4,1 title " << Quoted(Title(episode))
      << " noenhanced\n"
      << "set grid\nset key outside right noenhanced\nset lmargin 12\n"
      << "set rmargin 26\nset xlabel ''\n"
      << "set autoscale xfix\n"
      << "set label 1 'detected ' at first 0, graph 0.94 right tc rgb "
         "'#d62728'\n";
  if (episode.isolated_ns) {
    out << "set label 2 ' isolated' at first "
        << Number(SecondsFrom(*episode.isolated_ns, episode.detected_ns))
        << ", graph 0.94 left tc rgb '#1f77b4'\n";
  }
  out << "set ylabel " << Quoted("flow F [" + unit + "]") << '\n'
      << "plot $data u 1:4 w l lc rgb '#000000' t 'F measured', $data u 1:6 w "
         "l lc rgb '#2ca02c' t 'F normal observer'\n"
      << "unset label 1\nunset label 2\n"
      << "set ylabel 'displacement X [%]'\n"
      << "plot $data u 1:2 w l lc rgb '#aaaaaa' t 'CV', $data u 1:3 w l lc rgb "
         "'#000000' t 'X measured', $data u 1:5 w l lc rgb '#2ca02c' t 'X "
         "normal observer'\n"
      << "set ylabel 'residual r = y - yhat'\nplot ";
  for (std::size_t c = 0; c < episode.channels.size(); ++c) {
    const std::string& name = episode.channels[c];
    out << (c == 0 ? "" : ", ")
        << "$data u 1:" << kFirstResidual + static_cast<int>(c) << " w l t "
        << Quoted("r " + name +
                  (name == "F"   ? " [" + unit + "]"
                   : name == "X" ? " [%]"
                                 : ""));
  }
  const int first_factor =
      kFirstResidual + static_cast<int>(episode.channels.size());
  out << "\nset ylabel 'decision factor d [-]'\nset yrange [-0.05:1.05]\n"
      << "set xlabel 'time from detection [s]'\n"
      << "plot $data u 1:" << first_factor
      << " w l lc rgb '#000000' t 'normal'";
  for (std::size_t f = 0; f < episode.faults.size(); ++f) {
    out << ", $data u 1:" << first_factor + 1 + static_cast<int>(f)
        << " w l lw " << ((episode.fault_bits >> f & 1U) != 0 ? 3 : 1) << " t "
        << Quoted(episode.faults[f]);
  }
  out << "\nunset multiplot\n";
}

// A folder for the script that is removed in the end.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name =
        (std::filesystem::temp_directory_path() / "fdi-plot-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw std::system_error(errno, std::generic_category(), name);
    }
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void RunGnuplot(const std::filesystem::path& script) {
  std::string name = "gnuplot";
  std::string argument = script.string();
  char* arguments[] = {name.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int code =
      posix_spawnp(&child, "gnuplot", nullptr, nullptr, arguments, environ);
  if (code != 0) {
    throw std::runtime_error(std::string("gnuplot cannot run: ") +
                             std::strerror(code) +
                             "; on Debian it is in gnuplot-nox");
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("gnuplot failed, see above");
  }
}

}  // namespace

void PlotEpisode(const Episode& episode, const std::vector<TraceInstant>& trace,
                 const std::filesystem::path& output,
                 const PlotOptions& options) {
  const std::string ending = output.extension().string();
  if (ending != ".png" && ending != ".svg") {
    throw ConfigError("cannot draw " + output.string() +
                      "; accepted endings are .png and .svg");
  }
  std::vector<TraceInstant> drawn;
  std::copy_if(trace.begin(), trace.end(), std::back_inserter(drawn),
               [&](const TraceInstant& instant) {
                 return IsDrawn(episode, instant, options);
               });
  if (drawn.empty()) {
    throw DataError("episode " + episode.episode_id +
                    " has no trace in that time");
  }
  const ScratchFolder scratch;
  const std::filesystem::path script = scratch.path() / "plot.gp";
  std::ofstream out(script);
  out << "set terminal "
      << (ending == ".png" ? "pngcairo size 1200,1300"
                           : "svg size 1200,1300 dynamic")
      << "\nset output " << Quoted(output.string()) << '\n';
  WriteData(episode, drawn, out);
  WriteMarks(episode, out);
  WritePanels(episode, out);
  out.close();
  if (!out) {
    throw std::runtime_error("cannot write " + script.string());
  }
  RunGnuplot(script);
}

}  // namespace fdi::storage
