// Says new alarms to screen readers, in the title and nowhere else: many at
// once become a number.

import {faultTitle} from './faults.js';
import {store} from './store.js';

const kPauseMs = 1000;

export function startAnnouncements(node) {
  let waiting = [];
  const say = () => {
    const text = waiting.length > 3 ? `${waiting.length} new alarms` :
      waiting.map((row) => `New alarm: ${row.valve}, ${faultTitle(row.fault)}`)
          .join('. ');
    waiting = [];
    node.replaceChildren(document.createTextNode(text));
  };
  store.addEventListener('alarms', ({detail}) => {
    if (!detail?.isNew || detail.row.isa !== 'UNACK') return;
    if (waiting.push(detail.row) === 1) setTimeout(say, kPauseMs);
  });
}
