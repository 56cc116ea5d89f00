// Bars by day, as SVG with a table of the same numbers for who cannot see it.

import {h, svg} from '../dom.js';
import {numberText} from '../format.js';

const kWidth = 640;
const kHeight = 150;
const kLeft = 44;
const kBottom = 24;

// 1, 2 or 5 times a power of ten, so that about three lines are drawn.
function stepFor(max) {
  const power = 10 ** Math.floor(Math.log10(max / 3));
  return [1, 2, 5, 10].map((m) => m * power).find((step) => max / step <= 4);
}

function gridLines(max, step, yOf) {
  const lines = [];
  for (let value = 0; value <= max + 1e-9; value += step) {
    lines.push(svg('line', {'class': 'grid', 'x1': kLeft, 'x2': kWidth,
      'y1': yOf(value), 'y2': yOf(value)}),
    svg('text', {'x': kLeft - 6, 'y': yOf(value) + 4, 'text-anchor': 'end'},
        String(Number(value.toPrecision(3)))));
  }
  return lines;
}

/** `bars`: [{name, value}]; whole numbers have whole steps. */
export function barChart(title, unit, bars, whole = false) {
  const most = Math.max(...bars.map((bar) => bar.value), whole ? 3 : 0) || 1;
  const step = Math.max(stepFor(most), whole ? 1 : 0);
  const max = Math.ceil(most / step) * step;
  const yOf = (value) =>
    kHeight - kBottom - (kHeight - kBottom - 8) * value / max;
  const wide = (kWidth - kLeft) / Math.max(1, bars.length);
  const every = Math.ceil(bars.length / 8);
  const chart = svg('svg', {'viewBox': `0 0 ${kWidth} ${kHeight}`,
    'class': 'bars', 'role': 'img', 'aria-label': `${title}, table below`},
  gridLines(max, step, yOf),
  bars.map(({name, value}, i) => [
    svg('rect', {x: kLeft + i * wide + 0.1 * wide, y: yOf(value),
      width: 0.8 * wide, height: Math.max(0, kHeight - kBottom - yOf(value))},
    svg('title', {}, `${name}: ${numberText(value)} ${unit}`)),
    i % every === 0 ? svg('text', {'x': kLeft + (i + 0.5) * wide,
      'y': kHeight - 3, 'text-anchor': 'middle'}, name.slice(5)) : null]));
  return h('figure', {}, h('figcaption', {}, title), chart,
      h('details', {}, h('summary', {}, 'As a table'),
          h('table', {class: 'small'},
              h('thead', {}, h('tr', {}, h('th', {scope: 'col'}, 'Day'),
                  h('th', {scope: 'col'}, title))),
              h('tbody', {}, bars.map(({name, value}) => h('tr', {},
                  h('th', {scope: 'row'}, name),
                  h('td', {class: 'num'}, numberText(value))))))));
}

/** A number and its share of the greatest, for a cell of a table. */
export function barCell(value, most, text = numberText(value)) {
  const fill = h('span', {class: 'bar-fill'});
  fill.style.width =
    `${most > 0 ? Math.max(0, Math.min(100, 100 * value / most)) : 0}%`;
  return h('span', {class: 'bar-box'}, h('span', {class: 'num'}, text),
      h('span', {'class': 'bar', 'aria-hidden': 'true'}, fill));
}
