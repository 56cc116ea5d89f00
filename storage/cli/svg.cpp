#include "storage/cli/svg.h"

#include <cmath>
#include <cstdio>

namespace fdi::cli {
namespace {

constexpr double kTickGap = 5.0;   // px from the frame to a tick label
constexpr double kTextRise = 3.5;  // px from the middle of a line to its base
constexpr double kLegendStep = 15.0;  // px
constexpr double kLegendStroke = 18.0;

std::string Attribute(std::string_view name, double pixels) {
  return ' ' + std::string(name) + "=\"" + SvgNumber(pixels) + '"';
}

std::string ClassAttribute(std::string_view classes) {
  return classes.empty() ? "" : " class=\"" + std::string(classes) + '"';
}

SvgScale Widened(const SvgAxis& axis, double at_from, double at_to) {
  SvgScale scale{axis.from, axis.to, at_from, at_to};
  if (!(scale.to > scale.from)) {
    const double margin = scale.from == 0.0 ? 1.0 : 0.1 * std::abs(scale.from);
    scale.from -= margin;
    scale.to = scale.from + 2.0 * margin;
  }
  return scale;
}

}  // namespace

std::string_view SvgStyle() {
  return R"(.plot{background:#fff;font-family:system-ui,"DejaVu Sans",sans-serif;font-size:11px}
.plot text{fill:#222}
.plot text.head{font-size:12px;font-weight:600}
.plot text.end{text-anchor:end}
.plot text.middle{text-anchor:middle}
.plot path,.plot line{fill:none;stroke:#222;stroke-width:1.2;stroke-linejoin:round}
.plot .frame{fill:none;stroke:#888;stroke-width:1}
.plot .grid{stroke:#ddd;stroke-width:.6}
.plot .limit{stroke:#555;stroke-width:1;stroke-dasharray:6 3}
.plot .mark{stroke:#555;stroke-width:1;stroke-dasharray:1.5 2.5}
.plot .s1,.plot .s8,.plot .s15{stroke:#d55e00}
.plot .s2,.plot .s9,.plot .s16{stroke:#0072b2}
.plot .s3,.plot .s10,.plot .s17{stroke:#009e73}
.plot .s4,.plot .s11,.plot .s18{stroke:#cc79a7}
.plot .s5,.plot .s12,.plot .s19{stroke:#e69f00}
.plot .s6,.plot .s13,.plot .s20{stroke:#56b4e9}
.plot .s7,.plot .s8,.plot .s9,.plot .s10,.plot .s11,.plot .s12,.plot .s13{stroke-dasharray:7 3}
.plot .s14,.plot .s15,.plot .s16,.plot .s17,.plot .s18,.plot .s19,.plot .s20{stroke-dasharray:2 2}
.plot .wide{stroke-width:2.2}
.plot .main{stroke-width:1.8;stroke-opacity:.75}
.plot .bar{fill:#56b4e9;fill-opacity:.6;stroke:none}
.plot .right{fill:#009e73}
.plot .partly{fill:#56b4e9}
.plot .wrong{fill:#d55e00}
.plot .open{fill:#999}
.plot text.inside{fill:#000;text-anchor:middle}
@media (prefers-color-scheme:dark){
.plot{background:#161616}
.plot text{fill:#ddd}
.plot path,.plot line{stroke:#eee}
.plot .frame{stroke:#777}
.plot .grid{stroke:#333}
.plot .limit,.plot .mark{stroke:#aaa}
.plot .s1,.plot .s8,.plot .s15{stroke:#f0762a}
.plot .s2,.plot .s9,.plot .s16{stroke:#3a94d4}
.plot .s3,.plot .s10,.plot .s17{stroke:#00b887}
.plot .s4,.plot .s11,.plot .s18{stroke:#cc79a7}
.plot .s5,.plot .s12,.plot .s19{stroke:#e69f00}
.plot .s6,.plot .s13,.plot .s20{stroke:#8fd0f5}
.plot text.inside{fill:#000}
}
)";
}

std::string XmlText(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string SvgNumber(double pixels) {
  const long halves = std::lround(2.0 * pixels);
  const long whole = std::abs(halves) / 2;
  std::string text = halves < 0 ? "-" : "";
  if (whole != 0 || halves % 2 == 0) {
    text += std::to_string(whole);
  }
  return halves % 2 == 0 ? text : text + ".5";
}

std::vector<double> RoundTicks(double from, double to, int count) {
  std::vector<double> ticks;
  if (!(to > from) || count < 1) {
    return ticks;
  }
  const double raw = (to - from) / count;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double step = power * (raw <= power         ? 1.0
                               : raw <= 2.0 * power ? 2.0
                               : raw <= 5.0 * power ? 5.0
                                                    : 10.0);
  for (double n = std::ceil(from / step - 1e-9); n * step <= to + 1e-9 * step;
       n += 1.0) {
    ticks.push_back(n * step + 0.0);  // no -0
  }
  return ticks;
}

std::string ShortNumber(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

SvgCanvas::SvgCanvas(double width, double height, std::string_view title)
    : width_(width), height_(height), title_(title) {}

void SvgCanvas::Line(double x1, double y1, double x2, double y2,
                     std::string_view classes) {
  body_ += "<line" + Attribute("x1", x1) + Attribute("y1", y1) +
           Attribute("x2", x2) + Attribute("y2", y2) + ClassAttribute(classes) +
           "/>\n";
}

void SvgCanvas::Rectangle(const SvgArea& area, std::string_view classes,
                          std::string_view hint) {
  body_ += "<rect" + Attribute("x", area.left) + Attribute("y", area.top) +
           Attribute("width", area.width) + Attribute("height", area.height) +
           ClassAttribute(classes);
  body_ +=
      hint.empty() ? "/>\n" : "><title>" + XmlText(hint) + "</title></rect>\n";
}

void SvgCanvas::Text(double x, double y, std::string_view text,
                     std::string_view classes) {
  body_ += "<text" + Attribute("x", x) + Attribute("y", y) +
           ClassAttribute(classes) + '>' + XmlText(text) + "</text>\n";
}

void SvgCanvas::Path(std::string_view data, std::string_view classes) {
  if (!data.empty()) {
    body_ += "<path d=\"" + std::string(data) + '"' + ClassAttribute(classes) +
             "/>\n";
  }
}

std::string SvgCanvas::Wrapped(std::string_view style) const {
  const std::string size = SvgNumber(width_) + ' ' + SvgNumber(height_);
  std::string text =
      "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 "
      "0 " +
      size + '"' + Attribute("width", width_) + Attribute("height", height_) +
      " role=\"img\">\n<title>" + XmlText(title_) + "</title>\n";
  if (!style.empty()) {
    text += "<style>" + std::string(style) + "</style>\n";
  }
  return text + body_ + "</svg>\n";
}

std::string SvgCanvas::Element() const {
  return Wrapped({});
}

std::string SvgCanvas::Document() const {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n" + Wrapped(SvgStyle());
}

SvgPanel::SvgPanel(SvgCanvas& canvas, const SvgArea& area,
                   const SvgAxis& horizontal, const SvgAxis& vertical)
    : area_(area),
      x_(Widened(horizontal, area.left, area.right())),
      y_(Widened(vertical, area.bottom(), area.top)) {
  DrawHorizontal(canvas, horizontal);
  DrawVertical(canvas, vertical);
  canvas.Rectangle(area_, "frame");
}

void SvgPanel::DrawHorizontal(SvgCanvas& canvas, const SvgAxis& axis) const {
  for (const double tick : RoundTicks(x_.from, x_.to, axis.ticks)) {
    canvas.Line(x_(tick), area_.top, x_(tick), area_.bottom(), "grid");
    if (axis.labelled) {
      canvas.Text(x_(tick), area_.bottom() + 14.0, ShortNumber(tick), "middle");
    }
  }
  if (axis.labelled && !axis.label.empty()) {
    canvas.Text(area_.left + 0.5 * area_.width, area_.bottom() + 29.0,
                axis.label, "middle");
  }
}

void SvgPanel::DrawVertical(SvgCanvas& canvas, const SvgAxis& axis) const {
  for (const double tick : RoundTicks(y_.from, y_.to, axis.ticks)) {
    canvas.Line(area_.left, y_(tick), area_.right(), y_(tick), "grid");
    if (axis.labelled) {
      canvas.Text(area_.left - kTickGap, y_(tick) + kTextRise,
                  ShortNumber(tick), "end");
    }
  }
  canvas.Text(area_.left + 4.0, area_.top - 4.0, axis.label);
}

std::string SvgSeries(std::size_t index) {
  return 's' + std::to_string(index % kSvgSeries);
}

void DrawLegend(SvgCanvas& canvas, double left, double top,
                const std::vector<SvgLegendEntry>& entries) {
  double y = top;
  for (const SvgLegendEntry& entry : entries) {
    canvas.Line(left, y, left + kLegendStroke, y, entry.classes);
    canvas.Text(left + kLegendStroke + kTickGap, y + kTextRise, entry.text);
    y += kLegendStep;
  }
}

}  // namespace fdi::cli
