// Draws below and above the lines of a panel: gaps, bands of thresholds, the
// state of the valve, marks of an episode.

import {cssColor} from '../dom.js';
import {markWord} from '../faults.js';
import {durationText} from '../format.js';

let hatchTile = null;
let hatchColor = '';

function hatch(context, color) {
  if (hatchColor !== color) {
    hatchTile = document.createElement('canvas');
    hatchTile.width = hatchTile.height = 8;
    const tile = hatchTile.getContext('2d');
    tile.strokeStyle = color;
    tile.lineWidth = 2;
    tile.beginPath();
    for (const shift of [-8, 0, 8]) {
      tile.moveTo(shift - 1, 9);
      tile.lineTo(shift + 9, -1);
    }
    tile.stroke();
    hatchColor = color;
  }
  return context.createPattern(hatchTile, 'repeat');
}

function clipped(u, draw) {
  const {ctx, bbox} = u;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  draw(ctx, bbox);
  ctx.restore();
}

const xOf = (u, ms) => u.valToPos(ms, 'x', true);

function drawLine(ctx, [fromX, fromY], [toX, toY], dash) {
  ctx.setLineDash(dash.map((d) => d * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(fromX, fromY);
  ctx.lineTo(toX, toY);
  ctx.stroke();
  ctx.setLineDash([]);
}

function drawLevel(u, ctx, {left, width}, value) {
  const y = u.valToPos(value, 'y', true);
  ctx.strokeStyle = cssColor('--ink-soft');
  ctx.lineWidth = devicePixelRatio;
  drawLine(ctx, [left, y], [left + width, y], [5, 4]);
}

function drawBand(u, ctx, box, {low, high}) {
  const top = u.valToPos(high, 'y', true);
  ctx.fillStyle = cssColor('--band');
  ctx.fillRect(box.left, top, box.width, u.valToPos(low, 'y', true) - top);
  drawLevel(u, ctx, box, high);
  drawLevel(u, ctx, box, low);
}

function drawGaps(u, ctx, {left, top, width, height}, gaps, first) {
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  for (const gap of gaps) {
    const from = Math.max(left, xOf(u, gap.from_ms));
    const to = Math.min(left + width,
        gap.to_ms === null ? left + width : xOf(u, gap.to_ms));
    if (to <= from) continue;
    ctx.fillStyle = hatch(ctx, cssColor('--hatch'));
    ctx.fillRect(from, top, Math.max(to - from, 2), height);
    const text = reasonText(gap) +
      (gap.to_ms === null ? '' : ` ${durationText(gap.to_ms - gap.from_ms)}`);
    if (first && ctx.measureText(text).width < to - from - 4) {
      ctx.fillStyle = cssColor('--ink-soft');
      ctx.textAlign = 'center';
      ctx.fillText(text, (from + to) / 2, top + height - 6 * devicePixelRatio);
    }
  }
}

/** "monitor down" */
export const reasonText = ({reason}) => reason.replaceAll('_', ' ');

// Detected: a thin strip along the upper edge; isolated: a thick one.
function drawRibbon(u, ctx, {top}, {table, priority}) {
  const {t, state} = table;
  ctx.fillStyle = cssColor(`--p${priority}`);
  for (let i = 1; i < t.length; ++i) {
    // Nothing is said of a gap, which has an instant without a state.
    if (!state[i - 1] || !state[i] || state[i] === 'NORMAL') continue;
    const from = xOf(u, t[i - 1]);
    const size = (state[i] === 'ISOLATED' ? 7 : 3) * devicePixelRatio;
    ctx.fillRect(from, top, Math.ceil(xOf(u, t[i]) - from), size);
  }
}

function drawMarks(u, ctx, {left, top, width, height}, marks, first) {
  const ratio = devicePixelRatio;
  ctx.font = `600 ${11 * ratio}px system-ui, sans-serif`;
  let lastX = -Infinity;
  let row = 0;
  for (const mark of [...marks].sort((a, b) => a.t_ms - b.t_ms)) {
    const x = xOf(u, mark.t_ms);
    if (x < left || x > left + width) continue;
    ctx.strokeStyle = ctx.fillStyle = cssColor('--ink');
    ctx.lineWidth = 1.5 * ratio;
    drawLine(ctx, [x, top], [x, top + height],
        mark.kind === 'DETECTED' ? [4, 3] : []);
    if (!first) continue;
    const text = markWord(mark.kind, mark.text);
    const room = ctx.measureText(text).width + 8 * ratio;
    row = x - lastX < room ? row + 1 : 0;
    lastX = x;
    const start = x + room > left + width ? x - room : x + 2 * ratio;
    ctx.fillStyle = cssColor('--raised');
    ctx.fillRect(start, top + (2 + 14 * row) * ratio, room - 2 * ratio,
        14 * ratio);
    ctx.fillStyle = cssColor('--ink');
    ctx.textAlign = 'left';
    ctx.fillText(text, start + 3 * ratio, top + (13 + 14 * row) * ratio);
  }
}

/** Hooks of uPlot for a panel; `scene` holds table, gaps and marks. */
export function overlayHooks(panel, scene, isFirst) {
  return {
    drawClear: [(u) => clipped(u, (ctx, box) => {
      if (panel.band) drawBand(u, ctx, box, panel.band);
      if (panel.threshold) drawLevel(u, ctx, box, panel.threshold);
      drawGaps(u, ctx, box, scene.gaps, isFirst);
    })],
    draw: [(u) => clipped(u, (ctx, box) => {
      if (panel.ribbon) drawRibbon(u, ctx, box, scene);
      drawMarks(u, ctx, box, scene.marks, isFirst);
    })],
  };
}
