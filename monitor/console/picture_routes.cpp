// Pictures of episodes, drawn by gnuplot as `fdi-store history plot` does.
#include <fstream>
#include <iterator>
#include <mutex>

#include <httplib.h>

#include "diagnosis/error.h"
#include "monitor/console/api.h"
#include "storage/plot/episode_figure.h"
#include "storage/plot/gnuplot.h"
#include "storage/plot/scratch_folder.h"

namespace fdi::console {
namespace {

std::string Contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string Draw(const Api& api, const std::string& id,
                 const std::string& ending) {
  if (!storage::HaveGnuplot()) {
    throw NotFoundError(
        "gnuplot is not installed; on Debian it is in gnuplot-nox");
  }
  storage::HistoryReader reader(api.sources.history);
  const storage::EpisodeEvidence evidence =
      storage::LoadEvidence(reader, id, api.sources.models);
  storage::EpisodeFigureOptions options;
  options.fault_name =
      api.texts.Words(evidence.episode.fault.value_or(""), 0.0).name;
  const storage::ScratchFolder scratch;
  const std::filesystem::path file = scratch.path() / ("picture." + ending);
  // One at a time: a picture takes a processor.
  static std::mutex drawing;
  const std::lock_guard lock(drawing);
  storage::DrawFigure(storage::EpisodeFigure(evidence, options), file);
  return Contents(file);
}

}  // namespace

void AddPictureRoutes(httplib::Server& server, const Api& api) {
  server.Get("/api/v1/episodes/([0-9a-f]{1,16}|last)\\.(svg|png)",
             AnsweringFile([&api](const httplib::Request& request) {
               const std::string id = request.matches[1];
               const std::string ending = request.matches[2];
               return FileAnswer{
                   ending == "svg" ? "image/svg+xml" : "image/png",
                   "episode-" + id + "." + ending, Draw(api, id, ending)};
             }));
}

}  // namespace fdi::console
