// Signs of alarms: shape, number and text say what the colour says.

import {svg} from './dom.js';

const kShapes = {
  1: 'M2 2h16v16H2z',
  2: 'M10 1l9.5 17H.5z',
  3: 'M.5 2h19L10 19z',
  4: 'M10 1a9 9 0 1 0 0 18a9 9 0 1 0 0-18z',
};
const kTextY = {1: 14, 2: 16, 3: 11.5, 4: 14};

/** Square, triangle, triangle on its tip, circle; hollow until isolated. */
export function prioritySign(priority, isolated = true) {
  return svg('svg', {
    'class': `sign p${priority}${isolated ? '' : ' hollow'}`,
    'viewBox': '0 0 20 20', 'aria-hidden': 'true', 'focusable': 'false',
  },
  svg('path', {d: kShapes[priority]}),
  svg('text', {x: 10, y: kTextY[priority], 'text-anchor': 'middle'},
      isolated ? String(priority) : '?'));
}
