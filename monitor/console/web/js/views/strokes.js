// Stroke tests of a valve, the newest first, each against the last one.

import {numberText, timeText} from '../format.js';
import {dataTable} from './table.js';

const kMost = 10;

const levels = ({cv_low_pct: low, cv_high_pct: high}) =>
  `${Math.round(low)} to ${Math.round(high)} %`;

const bothWays = (key) => ({rising, falling}) => [rising, falling]
    .map((way) => way[key] === null ? '–' : numberText(way[key])).join(' / ');

const verdict = ({last_start_utc: last, worse}) =>
  worse.length > 0 ? worse.join('; ') :
    last === null ? 'the first one with these levels' : 'as before';

const kColumns = [
  {text: 'At', header: true, cell: (row) => timeText(Date.parse(row.start_utc))},
  {text: 'Kind', cell: (row) => row.kind},
  {text: 'CV', cell: levels},
  {text: 'T63, CV rising / falling [s]', cell: bothWays('t63_s')},
  {text: 'T86 [s]', cell: bothWays('t86_s')},
  {text: 'Against the last one', cell: verdict},
];

export function strokeTests(tests) {
  if (tests.length === 0) return [];
  return [dataTable('Stroke tests', kColumns,
      tests.slice(-kMost).reverse())];
}
