// A trend as one picture: the panels below each other, with titles and legends.

import {cssColor, download, h} from '../dom.js';
import {dateText, clockText, zoneName} from '../format.js';

const kMargin = 16;
const kLine = 18;

function legendOf({panel, element}) {
  const entries = [...element.querySelectorAll('.legend button')];
  return panel.lines.map((line, i) => ({line, button: entries[i]}))
      .filter(({button}) => button.getAttribute('aria-pressed') === 'true');
}

function drawLegend(context, panel, x, y, ratio) {
  for (const {line} of legendOf(panel)) {
    context.strokeStyle = cssColor(line.color);
    context.lineWidth = 2 * ratio;
    context.setLineDash((line.dash ?? []).map((d) => d * ratio));
    context.beginPath();
    context.moveTo(x, y - 4 * ratio);
    context.lineTo(x + 22 * ratio, y - 4 * ratio);
    context.stroke();
    context.setLineDash([]);
    context.fillText(line.label, x + 27 * ratio, y);
    x += context.measureText(line.label).width + 45 * ratio;
  }
}

export function exportPng(timeline, title) {
  const {panels} = timeline;
  if (panels.length === 0) return;
  const ratio = devicePixelRatio || 1;
  const head = (2 * kMargin + kLine) * ratio;
  const heading = 2.4 * kLine * ratio;
  const width = panels[0].u.ctx.canvas.width + 2 * kMargin * ratio;
  const height = panels.reduce((sum, {u}) =>
    sum + u.ctx.canvas.height + heading, head + kMargin * ratio);
  const canvas = h('canvas', {width, height});
  const context = canvas.getContext('2d');
  context.fillStyle = cssColor('--raised');
  context.fillRect(0, 0, width, height);
  const font = (size, weight = 400) =>
    context.font = `${weight} ${size * ratio}px system-ui, sans-serif`;
  context.fillStyle = cssColor('--ink');
  font(15, 600);
  const now = Date.now();
  context.fillText(`${title}    saved ${dateText(now)} ${clockText(now)} ` +
    zoneName(), kMargin * ratio, (kMargin + kLine) * ratio);
  let y = head;
  for (const panel of panels) {
    context.fillStyle = cssColor('--ink');
    font(12, 600);
    context.fillText(panel.panel.title, kMargin * ratio, y + 14 * ratio);
    font(11);
    drawLegend(context, panel, kMargin * ratio, y + 32 * ratio, ratio);
    context.drawImage(panel.u.ctx.canvas, kMargin * ratio, y + heading);
    y += heading + panel.u.ctx.canvas.height;
  }
  const name = title.replace(/[^\w.-]+/g, '_');
  canvas.toBlob((blob) => download(`${name}.png`, blob), 'image/png');
}
