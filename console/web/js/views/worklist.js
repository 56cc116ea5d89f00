// The one list of what is wrong, with what loops share, what nothing judges and
// what is shelved.

import {get, url} from '../api.js';
import {button, errorNote, h, replace} from '../dom.js';
import {certaintyText, faultTitle, moreText, notJudgedText} from '../faults.js';
import {timeText} from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';
import {columns, dataTable, forText, timeCell, valveCell, valveLink}
  from './table.js';
import {View} from './view.js';

const number = (value, digits) => Number(value).toFixed(digits);

const utcCell = (text) => timeCell(text && Date.parse(text));

const utcText = (text) => timeText(Date.parse(text));

// A day that was given without a time is a midnight of UTC.
const dayText = (text) =>
  /T00:00:00(\.0*)?(Z|\+00:00)$/.test(text) ? text.slice(0, 10) : utcText(text);

function findingCell({name, fault, episode_id: id, ...row}) {
  const text = (!fault || fault === 'unknown' ? name :
    fault.includes('|') ? faultTitle(fault) : `${name} (${fault})`) +
    moreText(row);
  return id ? h('a', {href: link('episode', id)}, text) : text;
}

const workText = ({in_work_utc: since, order, expected_utc: back}) => !since ?
  null : ['in work', order && `order ${order}`,
    back && `expected back ${dayText(back)}`].filter(Boolean).join(', ');

// A valve that nobody judges now confirms nothing, though its alarm stands.
const stateText = (row) => [!row.open ? 'returned' : row.unconfirmed_utc ?
  `not confirmed since ${utcText(row.unconfirmed_utc)}` :
  notJudgedText(store.tiles.get(row.valve_id)) || 'stands',
row.acked_by && 'acknowledged', workText(row)].filter(Boolean).join('; ');

// A word, and the factor of the score that it is.
const weighed = (word, factor) => h('span', {title:
  'score = severity × how sure × grade'}, `${word} (×${factor})`);

const kRows = [
  {text: 'Rank', class: 'num', cell: (row) => String(row.rank)},
  columns.priority,
  {text: 'Valve', header: true, cell: (row) => valveCell(row.valve_id, row)},
  {text: 'Finding', class: 'fault', cell: findingCell},
  {text: 'Why', class: 'remark why', cell: ({why, shares}) =>
    shares ? `${why}; shares ${shares}` : why},
  {text: 'State', cell: stateText},
  {text: 'Severity', class: 'wide', cell: (row) =>
    weighed(row.severity, number(row.severity_points, 0))},
  {text: 'How sure', class: 'wide sure', cell: (row) =>
    weighed(certaintyText(row) || '–', number(row.confidence, 2))},
  {text: 'Grade', class: 'wider', cell: (row) =>
    weighed(row.grade ?? '–', number(row.grade_factor, 1))},
  {text: 'Score', class: 'num wider', cell: (row) => number(row.score, 2)},
  {text: 'For', class: 'wider', cell: (row) => forText(row.discipline)},
  {text: 'What to check', class: 'remark check', cell: (row) =>
    row.check ?? '–'},
];

const kShared = [
  {text: 'Share', header: true, cell: (row) => row.shares},
  {text: 'Group', cell: (row) => row.group ?? '–'},
  {text: 'Faults', said: true, cell: (row) => 
    row.faults.map((fault) => faultTitle(fault)).join(', ') || '–'},
  {text: 'Since', said: true, cell: (row) => utcCell(row.since_utc)},
  {text: 'Ended', said: true, cell: (row) => utcCell(row.ended_utc)},
  {text: 'Loops', said: true, cell: (row) => row.valve_ids.map((valve, i) =>
    [i > 0 ? ', ' : null, valveLink(valve)])},
];

const kUnjudged = [
  {text: 'Loop', header: true, cell: (row) => valveLink(row.valve_id)},
  {text: 'Judged', class: 'num', said: true, cell: (row) =>
    `${number(100 * row.judged_share, 1)} %`},
  {text: 'Mostly because', class: 'remark', cell: (row) => row.reason},
];

const kDone = [
  {text: 'Valve', header: true, cell: (row) => valveLink(row.valve_id)},
  {text: 'Finding', cell: findingCell},
  {text: 'Done', said: true, cell: (row) => utcCell(row.done_utc)},
  {text: 'By', said: true, cell: (row) => row.who ?? '–'},
  {text: 'What', class: 'remark', cell: (row) => row.what},
];

const kShelved = [
  {text: 'Valve', header: true, cell: (row) => valveLink(row.valve_id)},
  {text: 'Fault', said: true, cell: (row) =>
    row.fault ? faultTitle(row.fault) : 'any'},
  {text: 'Until', said: true, cell: (row) => utcCell(row.until_utc)},
  {text: 'By', said: true, cell: (row) => row.who},
  {text: 'Comment', class: 'remark', cell: (row) => row.comment ?? '–'},
];

const part = (title, list, rows) => rows.length === 0 ? null :
  [h('h2', {}, title), dataTable(title, list, rows, {layout: 'cards'})];

function coverageText({loops: all, named_faults: named, audit, nothing}) {
  return `${all - nothing} of ${all} loops are watched: ${named} for named ` +
      `faults, ${audit} by the audit only, ${nothing} by nothing.`;
}

class Worklist extends View {
  title = 'Work list';
  #list = h('div', {}, h('p', {}, 'Loading …'));

  constructor() {
    super();
    this.element = h('section', {},
        h('div', {class: 'controls'}, h('h1', {}, 'Work list'),
            h('a', {class: 'button', href: url('/worklist.html'),
              target: '_blank', rel: 'noopener'}, 'Page to print'),
            h('a', {class: 'button', href: url('/worklist.csv'),
              download: 'worklist.csv'}, 'Save as CSV'),
            button('Refresh', () => this.#load())), this.#list);
    this.#load();
  }

  async #load() {
    try {
      this.#show(await get('/worklist'));
    } catch (error) {
      replace(this.#list, errorNote(error));
    }
  }

  #show(list) {
    replace(this.#list,
        h('p', {}, `As of ${utcText(list.as_of_utc)}, since ` +
            `${utcText(list.since_utc)}. ` + coverageText(list.coverage)),
        list.rows.length === 0 ?
          h('p', {class: 'nothing'},
              list.coverage.nothing === list.coverage.loops ?
                'Nothing was judged yet.' :
                'Nothing to do: no valve stands out.') :
          dataTable('Work list, the worst first', kRows, list.rows,
              {layout: 'cards'}),
        part('Loops that share a cause', kShared, list.shared),
        part('What could not be judged, and why', kUnjudged, list.unjudged),
        part('Done, and watched for their return', kDone, list.done),
        part('Shelved, and therefore not in the list', kShelved,
            list.shelved));
  }
}

export const worklistView = () => new Worklist();
