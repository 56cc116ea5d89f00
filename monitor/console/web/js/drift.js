// How far the limits of a valve have followed it, in words.

import {numberText, timeText} from './format.js';

const kTold = 0.1;  // Of the bound; less is nobody's concern.

const signed = (value) => (value > 0 ? '+' : '') + numberText(value);

function endOf(sinceMs) {
  return sinceMs === null ? '.' :
    `. They have been at this bound since ${timeText(sinceMs)}; ` +
    'a drift beyond it raises an alarm.';
}

/** A sentence for each mean and scale that moved; `drift`: docs/console.md. */
export function driftLines(drift) {
  const lines = [];
  for (const d of drift) {
    const unit = d.unit ? ` ${d.unit}` : '';
    if (d.mean_used > kTold) {
      lines.push(`Limits of ${d.channel} have followed a drift of ` +
          `${signed(d.mean)}${unit} (at most ` +
          `${numberText(Math.abs(d.mean_bound))}${unit})` +
          endOf(d.mean_full_since_ms));
    }
    if (d.scale_used > kTold) {
      lines.push(`Limits of ${d.channel} are ${numberText(d.scale)} times as ` +
          'wide as trained, because its noise has grown (at most ' +
          `${numberText(d.scale_bound)} times)` + endOf(d.scale_full_since_ms));
    }
  }
  return lines;
}
