// The state of all loops: the worst, what they share, what nothing judges, and
// what watches them.

import {get, url} from '../api.js';
import {button, errorNote, h, replace} from '../dom.js';
import {timeText} from '../format.js';
import {link} from '../route.js';
import {dataTable, forText, timeCell, valveLink} from './table.js';
import {View} from './view.js';

const number = (value, digits) => Number(value).toFixed(digits);

const utcCell = (text) => timeCell(text && Date.parse(text));

const loops = (row) => row.valve_ids.map((valve, i) =>
  [i > 0 ? ', ' : null, valveLink(valve)]);

function findingCell({name, fault, episode_id: id}) {
  const text = `${name} (${fault})`;
  return id ? h('a', {href: link('episode', id)}, text) : text;
}

const kFinding = [
  {text: 'Rank', class: 'num', cell: (row) => String(row.rank)},
  {text: 'Loops', header: true, cell: loops},
  {text: 'Finding', class: 'fault', cell: findingCell},
  {text: 'Severity', cell: (row) =>
    `${row.severity} · ${number(row.severity_points, 0)}`},
  {text: 'Grade', class: 'wide', cell: (row) =>
    `${row.grade ?? '–'} · ${number(row.grade_factor, 1)}`},
  {text: 'How sure', cell: (row) =>
    `${row.certainty ?? '–'} · ${number(row.confidence, 2)}`},
  {text: 'Score', class: 'num wide', cell: (row) => number(row.score, 2)},
  {text: 'State', cell: (row) => row.open ? 'open' : 'ended'},
];

const kWorst = [...kFinding,
  {text: 'What to do', class: 'remark check', cell: (row) => row.check},
  {text: 'For', cell: (row) => forText(row.discipline)},
  {text: 'Seen by, label', class: 'wider', cell: (row) =>
    `${row.acked_by ?? '–'}, ${row.label ?? '–'}`},
  {text: 'Shares', class: 'wider', cell: (row) => row.shares ?? '–'},
];

const kShared = [
  {text: 'Share', header: true, cell: (row) => row.shares},
  {text: 'Group', cell: (row) => row.group ?? '–'},
  {text: 'Faults', cell: (row) => row.faults.join(', ') || '–'},
  {text: 'Since', cell: (row) => utcCell(row.since_utc)},
  {text: 'Ended', cell: (row) => utcCell(row.ended_utc)},
  {text: 'Loops', cell: loops},
];

const kUnjudged = [
  {text: 'Loop', header: true, cell: (row) => valveLink(row.valve_id)},
  {text: 'Judged', class: 'num', cell: (row) =>
    `${number(100 * row.judged_share, 1)} %`},
  {text: 'Mostly because', class: 'remark', cell: (row) => row.reason},
];

const kShelved = [
  {text: 'Loop', header: true, cell: (row) => valveLink(row.valve_id)},
  {text: 'Fault', cell: (row) => row.fault ?? 'any'},
  {text: 'Until', cell: (row) => utcCell(row.until_utc)},
  {text: 'By', cell: (row) => row.who},
  {text: 'Comment', class: 'remark', cell: (row) => row.comment ?? '–'},
];

function part(title, columns, rows, empty) {
  return [h('h2', {}, title), rows.length === 0 ?
    h('p', {class: 'nothing'}, empty) :
    dataTable(title, columns, rows, {layout: 'cards'})];
}

function coverageText({loops: all, named_faults: named, audit, nothing}) {
  return `${all - nothing} of ${all} loops are watched: ${named} for named ` +
      `faults, ${audit} by the audit only, ${nothing} by nothing.`;
}

class FleetReport extends View {
  title = 'Report';
  #parts = h('div', {}, h('p', {}, 'Loading …'));

  constructor() {
    super();
    this.element = h('section', {},
        h('div', {class: 'controls'}, h('h1', {}, 'Report'),
            h('a', {class: 'button', href: url('/report.html'),
              target: '_blank', rel: 'noopener'}, 'Page to print'),
            h('a', {class: 'button', href: url('/report'),
              download: 'report.json'}, 'Save as JSON'),
            button('Renew', () => this.#load())), this.#parts);
    this.#load();
  }

  async #load() {
    try {
      this.#show(await get('/report'));
    } catch (error) {
      replace(this.#parts, errorNote(error));
    }
  }

  #show(report) {
    replace(this.#parts,
        h('p', {}, `${timeText(Date.parse(report.since_utc))} to ` +
            `${timeText(Date.parse(report.made_utc))}. ` +
            coverageText(report.coverage)),
        part('The worst first', kWorst, report.worst, 'Nothing was found.'),
        report.others.length === 0 ? null :
          part('The other findings', kFinding, report.others, ''),
        part('Loops that share a cause', kShared, report.shared, 'None.'),
        part('What could not be judged, and why', kUnjudged, report.unjudged,
            'Every loop was judged for at least half of the time.'),
        report.shelved.length === 0 ? null :
          part('Shelved, and therefore not among the findings', kShelved,
              report.shelved, ''));
  }
}

export const reportView = () => new FleetReport();
