// The evidence of one episode: what was read and decided from before detection
// to the clearing, what people did, what the models were.

import {actionButtons} from '../actions.js';
import {get, path, url} from '../api.js';
import {exportPng} from '../charts/export.js';
import {Timeline} from '../charts/timeline.js';
import {TrendData} from '../charts/trend_data.js';
import {button, errorNote, factList, h, replace, setText} from '../dom.js';
import {certaintyNode, faultTitle, groupName, layerText, markWord, members,
  moreText, namurText, priorityNames, priorityOf, prioritySign, rowTitle,
  stateWord, unconfirmedText} from '../faults.js';
import {durationText, intervalText, percentText, rangeText,
  strengthText, unitText, wholePercent, zoneName}
  from '../format.js';
import {link} from '../route.js';
import {store} from '../store.js';
import {aboutNodes, dataTable, forText, labelText, lastedText, timeCell, valveLink}
  from './table.js';
import {View} from './view.js';

const kEndWords = {
  cleared: 'normal again', stream_ended: 'the publisher ended its stream',
  stale_timeout: 'no samples for too long', model_changed: 'model set changed',
  superseded: 'another episode took over', unknown: 'the monitor was down meanwhile',
};

// "strong, 52 % (50 % to 54 %)"
const inWords = (strength, percent) =>
  [strengthText(strength), percent].filter(Boolean).join(', ');

function facts({episode: row, model_hash: hash}) {
  return [
    ['Valve', valveLink(row.valve)],
    ...(row.about ? [['Description', h('span', {}, aboutNodes(row.about))]] :
      []),
    ['Fault', h('span', {class: 'with-sign'},
        prioritySign(priorityOf(row), members(row.fault).length > 0),
        [rowTitle(row) + moreText(row), row.witness]
            .filter(Boolean).join(', '))],
    ['Priority', priorityNames[priorityOf(row)]],
    // An episode with data that ended is not closed: it stands.
    ['State', unconfirmedText(row) ?
      `${unconfirmedText(row)}; ${groupName(row).toLowerCase()}` :
      `${stateWord(row.state)}; ${groupName(row).toLowerCase()}`],
    ['Detected', timeCell(row.detected_ms)],
    ['Named', row.isolated_ms === null ? '–' : h('span', {},
        timeCell(row.isolated_ms), `, ${durationText(
            row.isolated_ms - row.detected_ms)} after detection`)],
    ['Cleared', timeCell(row.cleared_ms)],
    ['Lasted', lastedText(row)],
    ['End', row.end_reason ? kEndWords[row.end_reason] ?? row.end_reason :
      'still open'],
    ['How sure', certaintyNode(row, '')],
    ['Strength', inWords(row.strength, intervalText(
        {...row, value: row.strength}, percentText, '', wholePercent))],
    ['At its worst', inWords(row.worst_strength,
        percentText(row.worst_strength))],
    ['For', forText(row.discipline)],
    ['NE 107', namurText(row.namur)],
    ['Label', labelText(row.label)],
    ['Acknowledged', row.acked_by ?
      h('span', {}, row.acked_by, ', ', timeCell(row.acked_ms)) : '–'],
    ['Model set', h('span', {}, row.model_set, ' ',
        h('code', {}, hash ?? ''))],
    ['Episode', h('code', {}, row.episode)],
  ];
}

function eventText(event) {
  const isolated = members(event.faults).length > 0;
  return [
    isolated ? faultTitle(event.faults) : null,
    isolated ? `strength ${percentText(event.strength)}` : null,
    isolated ? layerText(event.layer) : null,
    event.kind === 'LABEL' ? labelText(event.value) : event.value,
    event.reason && (kEndWords[event.reason] ?? event.reason),
    event.comment,
  ].filter(Boolean).join(', ');
}

// Work on the valve stands among what happened.
const withRepairs = ({events, repairs}) => [...events, ...(repairs ?? []).map(
    ({note, order, ...repair}) => ({...repair, comment: note,
      value: order && `order ${order}`}))]
    .sort((a, b) => a.at_ms - b.at_ms);

const kEventColumns = [
  {text: 'Time', cell: (event) => timeCell(event.at_ms)},
  {text: 'What', header: true, class: 'word', cell: (event) =>
    markWord(event.kind, event.faults)},
  {text: 'Details', class: 'remark', cell: eventText},
  {text: 'Who', cell: (event) => event.who ?? ''},
  {text: 'From where', class: 'wide', cell: (event) => event.origin ?? ''},
];

const kLookColumns = [
  {text: 'Fault', header: true, cell: ({fault}) => faultTitle(fault)},
  {text: 'Strength', cell: ({strength}) => percentText(strength)},
  {text: '95 % interval', cell: ({lowest, highest}) =>
    rangeText(lowest, highest, wholePercent) || 'not known'},
  {text: 'Begins', cell: ({begins_ms: begins, growing}) =>
    h('span', {}, timeCell(begins), growing ? ', growing' : '')},
];

function lookParts({faults, misfit}) {
  const times = `${Math.sqrt(misfit).toFixed(1)} times what is usual`;
  return faults.length === 0 ? h('p', {class: 'hint'},
      `No fault explains it: the best simulation misses by ${times}.`) : [
    dataTable('Faults that explain it, by simulation of the valve',
        kLookColumns, faults),
    h('p', {class: 'hint'}, 'The simulation with the first of them misses ' +
        `the readings by ${times}.`),
  ];
}

const kDay = 86_400_000;
const kUnits = [[kDay, 'days'], [3_600_000, 'hours'], [60_000, 'minutes']];

function fullText(full) {
  const [unit, name] = kUnits.find(([ms]) => full.value >= ms) ?? kUnits[2];
  return intervalText(full, (ms) => (ms / unit).toFixed(1), ` ${name}`);
}

function rateText(rate) {
  const text = (share) => `${(100 * Math.abs(share)).toFixed(1)} %`;
  const {value, lowest, highest} = rate;
  return lowest > 0 ? `growing by ${intervalText(rate, text, ' a day')}` :
    highest < 0 ? `falling by ${intervalText(
        {value, lowest: highest, highest: lowest}, text, ' a day')}` :
      'neither growing nor falling';
}

// The same sentence as `fdi-store history show`.
function growthPart(growth) {
  const {fault, strength: value, lowest, highest, rate, full_in_ms: full} =
      growth;
  const said = [
    `strength ${intervalText({value, lowest, highest}, percentText, '',
        wholePercent)}`,
    rate ? rateText(rate) : null,
  ].filter(Boolean).join(', ');
  return h('p', {class: 'growth'}, h('strong', {}, faultTitle(fault)), ': ',
      full ? `${said}; full in ${fullText(full)}` : said,
      ', as of ', timeCell(growth.at_ms), '.');
}

class EpisodePage extends View {
  title = 'Episode';
  #content = h('div', {});
  #timeline = null;
  #data = new TrendData();
  #row = null;

  #actions = h('div', {class: 'actions'});

  constructor({id}) {
    super();
    this.id = id;
    this.element = h('article', {class: 'episode'}, this.#content);
    replace(this.#content, h('h1', {}, 'Episode'), h('p', {}, 'Loading …'));
    this.on(store, 'alarms', (change) => {
      if (change?.row.episode === this.id) this.#load();
    });
    this.on(store, 'status', () => this.#showActions());
    this.atEnd(() => this.#timeline?.destroy());
    this.#load();
  }

  async #load() {
    try {
      const found = await get(path('episodes', this.id));
      if (this.gone) return;
      this.id = found.episode.episode;  // It may be asked for as the last one.
      this.#show(found);
    } catch (error) {
      if (this.gone) return;
      replace(this.#content, h('h1', {}, 'Episode'), errorNote(error));
    }
  }

  #showActions() {
    if (this.#row) {
      replace(this.#actions, actionButtons(this.#row, () => this.#load()));
    }
  }

  #show(found) {
    this.#row = found.episode;
    this.title = `${this.#row.valve}: ${rowTitle(this.#row)}`;
    this.#showActions();
    const checks = members(this.#row.fault)
        .map((fault) => store.faults.get(fault)).filter((f) => f?.check);
    this.#showTrend(found.trace);
    const copied = h('span', {role: 'status'});
    replace(this.#content,
        h('div', {class: 'controls'}, h('h1', {}, this.title), this.#actions),
        h('div', {class: 'row-end'},
            button('Copy the link', () => this.#copy(copied)), copied,
            this.#timeline ? button('Save as PNG', () => exportPng(
                this.#timeline, `${this.title}, episode ${this.id}`)) : null,
            h('a', {'class': 'button', 'download': `${this.id}.csv`,
              'href': url(path('episodes', `${this.id}.csv`))},
            'Save as CSV'),
            button('Print', () => window.print())),
        factList(facts(found)),
        found.growth.map(growthPart),
        this.#data.words ?
          h('p', {class: 'words'}, unitText(this.#data.words)) : null,
        checks.map(({name, check}) => h('p', {class: 'checks'},
            h('strong', {}, `${name}: `), check)),
        this.#timeline ? this.#timeline.element :
          h('p', {class: 'note'}, 'There is no recording of this episode.'),
        found.look ? lookParts(found.look) : null,
        dataTable('What happened', kEventColumns, withRepairs(found)),
        h('p', {class: 'hint'}, `Times are ${zoneName()}.`));
    if (this.#timeline) this.#timeline.rebuild();
  }

  #showTrend(trace) {
    if (!trace || trace.t_ms.length === 0) return;
    this.#data.load(trace, false);
    this.#data.priority = priorityOf(this.#row);
    this.#timeline ??= new Timeline(this.#data, {
      live: false, nowMs: () => store.nowMs(),
      describe: 'Trend of the episode; arrows move, plus and minus zoom',
    });
  }

  async #copy(said) {
    const address = new URL(link('episode', this.id), location.href).href;
    try {
      await navigator.clipboard.writeText(address);
      setText(said, 'copied');
    } catch {
      setText(said, address);
    }
  }
}

export const episodeView = (route) => new EpisodePage(route);
