// Views of the page over canned answers: cases that a real monitor gives only
// at the right moment.

import assert from 'node:assert/strict';
import {once} from 'node:events';
import {readFile} from 'node:fs/promises';
import {createServer} from 'node:http';
import {after, before, test} from 'node:test';

import {accessibilityFaults, close, launch, openShared, setScheme} from './browser.mjs';
import {until} from './programs.mjs';

const kWeb = new URL('../../console/web/', import.meta.url);
const kTypes = {html: 'text/html', js: 'text/javascript', css: 'text/css',
  svg: 'image/svg+xml'};
const kNowMs = Date.now();
const kDayMs = 86400000;
const kHealthCounts = ['travel_strokes', 'reversals', 'auto_h', 'shut_h',
  'open_h', 'at_limit', 'slip_jumps', 'slip_jump', 'dead_band', 'error_band',
  'delay', 't63', 't86', 'overshoot', 'travel_gain', 'single_readings'];
const kLongId = 'PLANT-HALL-NORTH-LIC-2107A';

/** A monitor of canned `answers`, by path; `asked` are its last requests. */
class Monitor {
  answers = {};
  asked = [];
  #streams = new Set();
  #server = createServer((...exchange) => this.#answer(...exchange));

  async start() {
    this.#server.listen(0, '127.0.0.1');
    await once(this.#server, 'listening');
    return `http://127.0.0.1:${this.#server.address().port}`;
  }

  stop() {
    this.#server.close();
    this.#server.closeAllConnections();
  }

  /** Forgets everything; `valves` and `alarms` are there at the start. */
  reset(valves = [], alarms = []) {
    this.asked = [];
    this.answers = {
      status: {now_ms: kNowMs, started_ms: kNowMs, instance: '1', health: 'OK',
        software: '0', plant: null, write: false, user: null,
        role: null, session: false, model_sets: []},
      faults: {faults: [{fault: 'f19', name: 'Flow transmitter wrong',
        check: 'Compare it.', severity: [{from: 0, level: 'high'}],
        label: true},
      {fault: 'f6', name: 'Plug worn', check: 'Look.', severity: [],
        label: true},
      {fault: 'x_stuck', name: 'Position stuck, whatever the command and ' +
        'the flow say, for longer than the loop can explain', check: '',
      severity: [], label: false}]},
      causes: {causes: []},
      valves: {valves}, alarms: {alarms}, worklist: {...kList, rows: []},
    };
  }

  async push(type, data) {
    await until(() => this.#streams.size > 0, 'a stream');
    for (const stream of this.#streams) {
      stream.write(`event: ${type}\ndata: ${JSON.stringify(data)}\n\n`);
    }
  }

  async #answer({url}, response) {
    const {pathname, search} = new URL(url, 'http://localhost');
    if (!pathname.startsWith('/api/v1/')) return this.#file(pathname, response);
    const path = pathname.slice('/api/v1/'.length);
    if (path === 'stream') return this.#stream(response);
    this.asked.push(path + search);
    const found = this.answers[path];
    const answer = typeof found === 'function' ? await found(search) : found;
    response.writeHead(answer ? 200 : 404).end(
        JSON.stringify(answer ?? {error: 'not there'}));
  }

  #stream(response) {
    response.writeHead(200, {'Content-Type': 'text/event-stream'});
    response.write('event: hello\ndata: ' +
      `{"now_ms": ${kNowMs}, "instance": "1"}\n\n`);
    this.#streams.add(response);
    response.once('close', () => this.#streams.delete(response));
  }

  async #file(path, response) {
    const name = path === '/' ? 'index.html' : path.slice(1)
        .replace(/^uplot/, 'vendor/uplot');
    try {
      const bytes = await readFile(new URL(name, kWeb));
      response.writeHead(200, {'Cache-Control': 'max-age=600',
        'Content-Type': kTypes[name.split('.').at(-1)]}).end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  }
}

function tile(id, state, faults = [], more = {}) {
  return {id, state, faults, quality: 'LIVE', reasons: '', missing: [],
    certainty: faults.length > 0 ? 'likely' : null,
    factor: faults.length > 0 ? 0.9 : null, strength: null, d0: 1,
    stamp_ms: kNowMs, since_ms: null, episode: null,
    model_set: 'm@1', shelved_until_ms: null, unacked: false, spark: [],
    ...more};
}

function alarm(episode, valve, fault, more = {}) {
  return {episode, valve, fault, layer: null, state: 'ISOLATED', isa: 'UNACK',
    shelved: null, detected_ms: kNowMs, isolated_ms: null, cleared_ms: null,
    ended_ms: null, returned_ms: null, end_reason: null, peak_factor: 0.9, strength: 0.5,
    certainty: fault ? 'likely' : 'not yet',
    label: null, acked_by: null, acked_ms: null, model_set: 'm@1',
    severity: 'high', score: 4, discipline: 'instrument', namur: 'failure',
    name: fault,
    check: '', ...more};
}

const monitor = new Monitor();
let browser;
let address;

before(async () => {
  [browser, address] = await Promise.all([launch(), monitor.start()]);
});

after(async () => {
  await browser?.close();
  monitor.stop();
});

test('a name that was withdrawn is not called a new one', async () => {
  monitor.reset([tile('A', 'NORMAL')]);
  const page = await openShared(browser, address, '#/');
  const words = await page.evaluate(async () => {
    const {markWord} = await import('/js/faults.js');
    return ['f3', '', null].map((faults) => markWord('REISOLATED', faults));
  });
  assert.deepEqual(words, ['renamed', 'name withdrawn', 'name withdrawn']);
});

test('a new valve leaves the worst ones first', async () => {
  monitor.reset([tile('A', 'NORMAL'), tile('C', 'NORMAL'),
    tile('Z', 'ISOLATED', ['f19'], {severity: 'high'})]);
  const page = await openShared(browser, address, '#/');
  await page.locator('.tile').first().waitFor();

  await monitor.push('tiles', {tiles: [tile('B', 'NORMAL')]});
  await page.locator('.tile', {hasText: 'B'}).waitFor();
  await monitor.push('tiles', {tiles: [tile('C', 'DETECTED')]});

  await until(async () => (await page.locator('.tile .tile-id')
      .allTextContents()).join('') === 'ZCAB', 'Z, C, A, B', 5000);
  await close(page);
});

test('what to check appears with the name of the fault', async () => {
  const episode = '0000000000000001';
  monitor.reset([tile('V', 'DETECTED', [], {episode})],
      [alarm(episode, 'V', null, {state: 'DETECTED'})]);
  const page = await openShared(browser, address, '#/valve/V');
  const state = page.locator('.state-line');
  await state.getByText('fault detected').waitFor();

  // The alarm is pushed at once, the tile with the next second.
  await monitor.push('alarm', alarm(episode, 'V', 'f19'));
  await monitor.push('tiles', {tiles: [tile('V', 'ISOLATED', ['f19'],
      {episode})]});
  await state.getByText('fault named').waitFor();

  assert.match(await page.locator('.checks').textContent(), /Compare it/);
  await close(page);
});

test('older episodes that are asked for twice come once', async () => {
  monitor.reset();
  monitor.answers.statistics = {per_day: [], valves: [], faults: [],
    labelled: {true: 0, false: 0, none: 0}, most_in_10_min: 0, gaps: []};
  let answerOlder;
  const older = new Promise((resolve) => answerOlder = resolve);
  const row = (n) => alarm(`000000000000000${n}`, `V${n}`, 'f19',
      {detected_ms: kNowMs - n});
  monitor.answers.history = (search) => search.includes('before_ms') ?
    older.then(() => ({episodes: [row(2)], more: false})) :
    {episodes: [row(1)], more: true};
  const page = await openShared(browser, address, '#/history');

  const more = page.getByRole('button', {name: 'Older ones'});
  await more.click();
  await more.click();
  await until(() => monitor.asked.filter((each) =>
    each.includes('before_ms')).length === 2, 'both requests');
  answerOlder();
  await page.getByRole('link', {name: 'V2'}).waitFor();
  await more.waitFor({state: 'hidden'});

  assert.equal(await page.locator('tbody tr', {hasText: 'V2'}).count(), 1);
  await close(page);
});

test('what is acknowledged is not acknowledged again by a second attempt',
    async () => {
      const rows = [1, 2].map((n) => alarm(`000000000000000${n}`, `V${n}`,
          'f19', {detected_ms: kNowMs - n}));
      monitor.reset([], rows);
      Object.assign(monitor.answers.status,
          {write: true, user: 'anna', role: 'acknowledge'});
      const ack = (n) => `episodes/${rows[n].episode}/ack`;
      monitor.answers[ack(0)] = {...rows[0], isa: 'ACKED'};
      const page = await openShared(browser, address, '#/alarms');
      await page.getByLabel('Select V1').click();
      await page.getByLabel('Select V2').click();
      await page.getByRole('button', {name: 'Acknowledge 2 selected'}).click();
      const send = page.getByRole('dialog')
          .getByRole('button', {name: 'Acknowledge'});

      await send.click();
      await page.getByRole('dialog').getByText('not there').waitFor();
      monitor.answers[ack(1)] = {...rows[1], isa: 'ACKED'};
      await send.click();
      await page.getByRole('dialog').waitFor({state: 'detached'});

      const asked = monitor.asked.filter((each) => each.endsWith('/ack'));
      assert.deepEqual(asked, [ack(0), ack(1), ack(1)]);
      await close(page);
    });

test('the figures of a year count all its episodes', async () => {
  monitor.reset();
  const day = (ms) => new Date(ms).toISOString().slice(0, 10);
  monitor.answers.history = {episodes: [], more: false};
  monitor.answers.statistics = {
    per_day: [{day: day(kNowMs - 300 * kDayMs), episodes: 5, alarm_s: 60},
      {day: day(kNowMs), episodes: 2, alarm_s: 60}],
    valves: [], faults: [], labelled: {true: 0, false: 0, none: 7},
    most_in_10_min: 1, gaps: []};
  const page = await openShared(browser, address,
      `#/history?since=${kNowMs - 365 * kDayMs}`);

  const episodes = page.locator('.facts div', {hasText: /^Episodes/});

  assert.equal(await episodes.locator('dd').first().textContent(), '7');
  await close(page);
});

/** A trend of `count` instants, each as `last` says. */
function trend(last, {count = 30, faults = ['f19', 'f6']} = {}) {
  const column = (value) => new Array(count).fill(value);
  return {valve: 'V', model_set: 'm@1', flow_unit: 'm3/h', T: 0.7, faults,
    channels: [{name: 'F', unit: 'm3/h', low: -2.5, high: 2.5}],
    t_ms: column(0).map((_, i) => kNowMs - 1000 * (count - i)),
    f: column(10), residuals: [column(last.residual ?? 0)],
    d0: column(last.d0), d: faults.map((_, f) => column(last.d[f])),
    state: column(last.state), quality: column('LIVE'),
    gaps: [], marks: [], words: ''};
}

test('a healthy valve shows no fault, and no number for one', async () => {
  monitor.reset([tile('V', 'NORMAL')]);
  monitor.answers['valves/V/trend'] =
    trend({state: 'NORMAL', d0: 0.97, d: [1, 0.99]});
  const page = await openShared(browser, address, '#/valve/V');
  const now = page.locator('.now-tables');
  await now.getByText('not excluded').waitFor();

  const text = await page.locator('.valve').innerText();
  assert.doesNotMatch(text, /Flow transmitter|f6|1\.00|0\.9/);
  assert.equal(await now.locator('tr.out').count(), 0);
  await close(page);
});

test('words say how sure a name is; the number is a hint', async () => {
  const episode = '0000000000000001';
  const more = {episode, factor: 0.93, strength: 0.004};
  monitor.reset([tile('V', 'ISOLATED', ['f19'], more),
    tile('W', 'ISOLATED', ['f19', 'f6'], {certainty: 'one of'}),
    tile('X', 'DETECTED', [], {certainty: 'not yet'}),
    tile('Y', 'DETECTED', [], {certainty: 'not known'})],
  [alarm(episode, 'V', 'f19', {peak_factor: 0.93, strength: 0.004})]);
  monitor.answers['valves/V/trend'] =
    trend({state: 'ISOLATED', d0: 0, d: [0.93, 0.5]});
  const page = await openShared(browser, address, '#/');
  const said = (id) => page.locator('.tile', {has:
    page.locator('.tile-id', {hasText: id})});
  await said('V').waitFor();

  assert.equal(await said('V').locator('.tile-certainty').innerText(),
      'likely');
  assert.match(await said('W').innerText(), /one of 2/);
  assert.match(await said('X').innerText(), /not yet known which/);
  assert.match(await said('Y').innerText(), /unlike any known fault/i);

  await page.goto(`${address}/#/valve/V`);
  await page.locator('.now-tables').getByText('not excluded').waitFor();
  const text = await page.locator('.valve').innerText();
  assert.doesNotMatch(text, /0\.93|factor|0 %/);
  assert.equal(await page.locator('.state-line').getByText('likely')
      .getAttribute('title'), 'decision factor 0.93');
  await page.goto(`${address}/#/alarms`);
  const row = page.locator('tr[data-episode]');
  await row.getByText('likely').waitFor();
  assert.doesNotMatch(await row.innerText(), /0\.93|\b0 %/);
  await close(page);
});

test('what is judged in part only is said, with the reason', async () => {
  monitor.reset([tile('half', 'PARTLY_JUDGED', [],
      {missing: ['P1'], unjudged: ['F']}),
  tile('wide', 'PARTLY_JUDGED', [], {blind: true}),
  tile('twin', 'PARTLY_JUDGED', [], {contested: true}),
  tile('bar', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
    refused: {reason: 'range', signals: ['P1'], flow_unit: 'm3/h'}}),
  tile('mass', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
    refused: {reason: 'unit', signals: ['F'], flow_unit: 'm3/h'}}),
  tile('blind', 'NOT_JUDGED', [], {quality: 'UNCOVERED', why: 'UNCOVERED cv',
    unjudged_since_ms: kNowMs - 700e3}),
  tile('held', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
    why: 'BAD_INPUT no_readings', unjudged_since_ms: kNowMs - 700e3}),
  tile('press', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
    refused: {reason: 'unit', signals: ['P1', 'P2'], flow_unit: 'm3/h'}}),
  tile('well', 'NORMAL')]);
  const page = await openShared(browser, address, '#/');
  const said = (id) => page.locator('.tile', {hasText: id}).innerText();
  await page.locator('.tile', {hasText: 'half'}).waitFor();

  assert.match(await said('half'), /Partly judged[^]*no P1; F not judged/);
  assert.match(await said('wide'), /limits too wide to see a fault/);
  assert.match(await said('twin'), /two publishers send it, the newest counts/);
  assert.match(await said('bar'), /bad input: P1 implausible: in another unit/);
  assert.match(await said('mass'), /flow in another unit than m³\/h/);
  assert.match(await said('blind'),
      /not judged since [^]*command beyond what was trained/);
  assert.match(await said('held'), /not judged since [^]*no new readings/);
  assert.match(await said('press'), /P1 or P2 in another unit than trained/);
  assert.deepEqual(await page.locator('.tile .tile-id').allTextContents(),
      ['bar', 'blind', 'half', 'held', 'mass', 'press', 'twin', 'wide', 'well']);
  await page.getByRole('button', {name: /Not or partly judged 8/}).waitFor();

  monitor.answers['valves/half/trend'] = {...trend({state: 'NORMAL', d0: 1,
    d: [0, 0]}), words: 'as the normal model expects'};
  await page.goto(`${address}/#/valve/half`);
  await page.locator('.state-line').getByText('no P1; F not judged').waitFor();
  await page.getByText('yes, as far as judged').waitFor();
  await page.getByText('expects, as far as it is judged').waitFor();
  assert.doesNotMatch(await page.locator('.state-line').innerText(), /normal/);
  await close(page);
});

test('the page of a valve that nobody judges now does not call it normal',
    async () => {
      const hourMs = 3600000;
      const since = {stamp_ms: kNowMs - hourMs};
      const refused = {reason: 'range', signals: ['P1'], flow_unit: 'm3/h'};
      monitor.reset([tile('ended', 'NOT_JUDGED', [], {...since, quality: 'ENDED'}),
        tile('bar', 'NOT_JUDGED', [], {quality: 'BAD_INPUT', refused}),
        tile('unit', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
          refused: {...refused, reason: 'unit'}}),
        tile('flow', 'NOT_JUDGED', [], {quality: 'BAD_INPUT',
          refused: {reason: 'unit', signals: ['F'], flow_unit: 't/h'}}),
        tile('well', 'NORMAL')]);
      for (const id of ['ended', 'bar', 'unit', 'flow', 'well']) {
        monitor.answers[`valves/${id}/trend`] = {...trend({state: 'NORMAL',
          d0: 1, d: [0, 0]}), words: 'as the normal model expects'};
        monitor.answers[`valves/${id}/health`] = {valve: id, step: 'day',
          t_ms: [kNowMs], status: ['good'], exceeded: [[]], channels: [],
          trends: [], ...Object.fromEntries(kHealthCounts.map((key) =>
            [key, [null]]))};
      }
      const page = await openShared(browser, address, '#/valve/ended');
      for (const width of [1400, 390]) {
        await page.setViewportSize({width, height: 800});
        for (const [id, words] of [['ended', /not confirmed since/],
          ['bar', /not judged: bad input: P1 implausible/],
          ['unit', /not judged: bad input: P1 in another unit than trained/],
          ['flow', /not judged: bad input: flow in another unit than t\/h/]]) {
          await page.goto(`${address}/#/valve/${id}`);
          await page.locator('.words', {hasText: words}).waitFor();
          const live = page.locator('.live');
          await live.getByText('Last residuals').waitFor();
          assert.doesNotMatch(await live.innerText(),
              /expects|\byes\b|within/i);
          await page.getByText('NE 107): check function, not ').waitFor();
        }
        await page.goto(`${address}/#/valve/well`);
        await page.locator('.words', {hasText: 'normal model expects'}).waitFor();
        await page.getByText('Residuals now').waitFor();
        await page.getByText('NE 107): good').waitFor();
      }
      // It falls silent while it is shown.
      await monitor.push('tiles', {tiles: [tile('well', 'NOT_JUDGED', [],
          {...since, quality: 'STALE'})]});
      await page.locator('.words', {hasText: 'not confirmed since'}).waitFor();
      await close(page);
    });

test('names that could not be fetched are fetched again', async () => {
  for (const [hash, place] of [['#/valve/V', '.state-line'],
    ['#/alarms', 'td.fault']]) {
    monitor.reset([tile('V', 'ISOLATED', ['f19'])],
        [alarm('0000000000000001', 'V', 'f19')]);
    const {faults} = monitor.answers;
    delete monitor.answers.faults;
    const page = await openShared(browser, address, hash);
    await page.locator(place, {hasText: 'f19'}).waitFor();
    monitor.answers.faults = faults;
    await page.locator(place, {hasText: 'Flow transmitter wrong'}).waitFor();
    await close(page);
  }
});

test('the page of an episode says what gave the name', async () => {
  const witness = 'named by simulation of the valve: f2 explains it 40 times ' +
    'better than f19, the observers are undecided';
  const row = alarm('0000000000000001', 'V', 'f19', {layer: 'physics', witness});
  monitor.reset([tile('V', 'ISOLATED', ['f19'])], [row]);
  monitor.answers[`episodes/${row.episode}`] = {episode: row, events: [],
    trace: null, model_hash: 'x', look: null, growth: []};
  for (const width of [1400, 390]) {
    const page = await openShared(browser, address,
        `#/episode/${row.episode}`, {viewport: {width, height: 800}});
    await page.getByText(`(f19), ${witness}`).waitFor();
    await close(page);
  }
});

test('what ended before it had a name is not unlike any known fault',
    async () => {
      monitor.reset([], [alarm('0000000000000001', 'V', 'unknown',
          {certainty: 'not yet', isa: 'RTN_UNACK', state: 'CLOSED',
            name: 'Fault that ended before it had a name'}),
      alarm('0000000000000002', 'W', 'unknown', {certainty: 'not known'})]);
      const page = await openShared(browser, address, '#/alarms');
      await page.locator('tr', {hasText: 'V'})
          .getByText('that ended before it had a name').waitFor();
      await page.locator('tr', {hasText: 'W'})
          .getByText('unlike any known fault').waitFor();
      await close(page);
    });

test('a label reaches alarm list, tile and valve page, at any size', async () => {
  const episode = '0000000000000001';
  const row = alarm(episode, 'V', 'f19');
  monitor.reset([tile('V', 'ISOLATED', ['f19'], {episode})], [row]);
  monitor.answers['valves/V/trend'] =
    trend({state: 'ISOLATED', d0: 0, d: [0.93, 0.5]});
  const page = await openShared(browser, address, '#/');
  await page.locator('.tile', {hasText: 'V'}).waitFor();

  await monitor.push('alarm', {...row, label: 'f6'});
  await page.locator('.tile', {hasText: 'label: was Plug worn'}).waitFor();

  await page.goto(`${address}/#/valve/V`);
  monitor.answers.alarms = {alarms: [{...row, label: 'f6'}]};
  await page.reload();
  await page.locator('.state-line', {hasText: 'was Plug worn'}).waitFor();
  await page.goto(`${address}/#/alarms`);
  for (const width of [1400, 390]) {
    await page.setViewportSize({width, height: 800});
    await page.locator('tr[data-episode]').getByText('label: was Plug worn')
        .waitFor();
  }
  await close(page);
});

test('the label dialog offers what is accepted, within its frame', async () => {
  monitor.reset([], [alarm('0000000000000001', 'V', 'x_stuck')]);
  Object.assign(monitor.answers.status,
      {write: true, user: 'anna', role: 'engineer'});
  const page = await openShared(browser, address, '#/alarms',
      {viewport: {width: 390, height: 800}});
  await page.getByRole('button', {name: 'Label V'}).click();
  const choice = page.getByLabel('What was it?');

  assert.deepEqual(await choice.locator('option').evaluateAll((options) =>
    options.map((option) => option.value)), ['true', 'false', 'f19', 'f6']);
  const frame = await page.getByRole('dialog').boundingBox();
  const box = await choice.boundingBox();
  assert.ok(box.x >= frame.x && box.x + box.width <= frame.x + frame.width);
  await close(page);
});

test('common causes stand above the alarms', async () => {
  monitor.reset();
  monitor.answers.causes = {causes: [{cause: '1', group: 'air header 2',
    opened_ms: kNowMs, members: ['A', 'B', 'C'].map((valve) =>
      ({episode: '0000000000000001', valve, fault: 'f19'}))}]};
  const page = await openShared(browser, address, '#/alarms');

  await page.getByText('Common cause in air header 2').waitFor();

  assert.match(await page.locator('.cause').innerText(),
      /since \S+: 3 valves, A, B, C/);
  await close(page);
});

test('a tile says since when and how strong, and cuts no id to sameness',
    async () => {
      const long = 'PLANT-NORTH-UNIT-0042-LINE-7-';
      monitor.reset([tile(`${long}LIC-101A`, 'ISOLATED', ['f19'],
          {since_ms: kNowMs - 60000, strength: 0.52, spark: [0, 0.9, 1, 1]}),
      // A healthy valve has single points that deviate: no line for them.
      tile(`${long}FIC-101A`, 'NORMAL', [], {spark: [0, 0.9, 0, 0.4, 0]})]);
      const page = await openShared(browser, address, '#/');
      const first = page.locator('.tile', {hasText: `${long}LIC`});
      await first.waitFor();

      assert.match(await first.locator('.tile-how').innerText(),
          /^strong, since \d\d:\d\d:\d\d$/);
      const ends = await page.locator('.tile-id > :last-child').evaluateAll(
          (nodes) => nodes.map((node) => [node.textContent,
            node.getBoundingClientRect().right <=
              node.closest('.tile').getBoundingClientRect().right]));
      assert.deepEqual(ends, [['LIC-101A', true], ['FIC-101A', true]]);
      assert.equal(await first.locator('.tile-id').getAttribute('title'),
          `${long}LIC-101A`);
      assert.equal(await page.locator('.spark:not([hidden])').count(), 1);
      await close(page);
    });

test('what looks the same is named where there is room, and covers nothing',
    async () => {
      const row = alarm('0000000000000001', kLongId, 'f19',
          {certainty: 'one of', look_alikes: ['f6'], factor: 0.9});
      monitor.reset([tile(kLongId, 'ISOLATED', ['f19'],
          {...row, since_ms: kNowMs - 3 * kDayMs, strength: -0.7}),
      tile('V', 'NOT_JUDGED', [], {active: true, fault: 'f19', strength: 0.5,
        certainty: 'likely', unconfirmed_ms: kNowMs - 3 * kDayMs})], [row]);
      for (const width of [1400, 390]) {
        const page = await openShared(browser, address, '#/',
            {viewport: {width, height: 800}});
        for (const density of ['comfortable', 'compact']) {
          await page.getByLabel('Size of the tiles').selectOption(density);
          const first = page.locator('.tile', {hasText: 'LIC-2107A'});
          await first.waitFor();
          const covered = await first.evaluate((node) => {
            const [tail, word] = ['.tile-id > :last-child', '.tile-certainty']
                .map((part) => node.querySelector(part).getBoundingClientRect());
            return tail.right > (word.left || innerWidth) ||
              tail.right > node.getBoundingClientRect().right;
          });
          assert.equal(covered, false, `${width} ${density}`);
        }
        await page.getByLabel('Size of the tiles').selectOption('comfortable');
        const said = await page.locator('.tile').allInnerTexts();
        assert.match(said[0], /one of 2\nFlow transmitter wrong or Plug worn\n/);
        assert.match(said[0], /strong, since \d{4}-\d\d-\d\d/);
        assert.match(said[1], /strong, not confirmed since \d{4}-\d\d-\d\d/);
        await page.goto(`${address}/#/alarms`);
        await page.locator('td.fault a', {hasText: 'or Plug worn'}).waitFor();
        await page.getByText('one of 2', {exact: true}).waitFor();
        await close(page);
      }
    });

test('a sign that flashes shows its number in both phases', async () => {
  monitor.reset([], [alarm('0000000000000001', 'V', 'f19')]);
  const page = await openShared(browser, address, '#/alarms');
  const sign = page.locator('tr.group-UNACK .sign').first();
  await sign.waitFor();
  const changes = await sign.evaluate((node) => node.getAnimations().flatMap(
      (animation) => animation.effect.getKeyframes()).flatMap(Object.keys));
  assert.ok(changes.includes('outlineColor'), 'it flashes');
  assert.ok(!changes.includes('opacity'), 'it fades');
  await close(page);
});

test('how the monitor is, and what time it has, is on any screen', async () => {
  monitor.reset();
  for (const [health, text] of [['OK', 'Monitor OK'],
    ['DEGRADED', 'Monitor degraded']]) {
    monitor.answers.status.health = health;
    for (const width of [1400, 390]) {
      const page = await openShared(browser, address, '#/',
          {viewport: {width, height: 800}});
      await page.getByText(text).waitFor();
      await page.locator('.tools .clock').waitFor();
      await close(page);
    }
  }
});

test('a plant without valves and a list without alarms say what comes',
    async () => {
      monitor.reset();
      const page = await openShared(browser, address, '#/');
      await page.getByText('appears with its first sample').waitFor();
      await page.goto(`${address}/#/alarms`);
      await page.getByText('No alarm is open').waitFor();
      assert.equal(await page.locator('thead').isVisible(), false);
      await close(page);
    });

test('plant, alarms and work list agree on order, counts and silence',
    async () => {
      const episode = (n) => `000000000000000${n}`;
      const shelf = {until_ms: kNowMs + kDayMs, who: 'bo', comment: ''};
      const named = (id, n, more) => tile(id, 'ISOLATED', ['f19'],
          {episode: episode(n), unacked: true, severity: 'high', ...more});
      monitor.reset([named('Aside', 1, {shelved_until_ms: shelf.until_ms}),
        named('Low', 2, {severity: 'critical'}),
        named('Seen', 3, {unacked: false}),
        named('Silent', 4, {quality: 'STALE', stamp_ms: kNowMs - 60000})],
      [alarm(episode(1), 'Aside', 'f19', {score: 16, shelved: shelf}),
        alarm(episode(2), 'Low', 'f19', {score: 1, severity: 'critical'}),
        alarm(episode(3), 'Seen', 'f19', {score: 9, isa: 'ACKED'}),
        alarm(episode(4), 'Silent', 'f19', {score: 4})]);
      monitor.answers.worklist = {...kList, rows: [{...kWork, fault: 'f19|f6',
        valve_id: 'Silent', certainty: 'one of', look_alikes: [],
        acked_by: null, expected_utc: '2026-12-09T00:00:00Z',
        in_work_utc: '2026-12-01T00:00:00Z'}], shelved: [{valve_id: 'Aside',
        fault: 'f19', until_utc: '2026-12-09T00:00:00Z', who: 'bo',
        comment: null}]};
      for (const width of [1400, 390]) {
        const page = await openShared(browser, address, '#/',
            {viewport: {width, height: 800}});
        await page.getByRole('button', {name: 'Unacknowledged 2'}).waitFor();
        const order = ['Seen', 'Silent', 'Low', 'Aside'];
        await until(async () => (await page.locator('.tile-id')
            .allTextContents()).join() === order.join(), 'the order', 5000);
        await page.goto(`${address}/#/alarms`);
        await page.getByRole('button', {name: 'Unacknowledged 2'}).waitFor();
        assert.deepEqual(await page.locator('tbody th').allInnerTexts(), order);
        await page.goto(`${address}/#/worklist`);
        await page.getByText(/^not confirmed since \d\d:\d\d:\d\d; in work, /)
            .waitFor();
        await page.getByText(/expected back 2026-12-09$/).waitFor();
        await page.getByText('one of 2 (×0.75)').waitFor();
        // A code never stands without its name.
        await page.getByText('Flow transmitter wrong (f19) or Plug worn (f6)',
            {exact: true}).waitFor();
        assert.equal(await page.locator('td').filter({hasText: /^f\d+$/})
            .count(), 0);
        await close(page);
      }
    });

test('labels of axes are the values of their lines', async () => {
  monitor.reset();
  const page = await openShared(browser, address, '#/');
  const labels = await page.evaluate(async () => {
    const {numberLabels} = await import('/js/charts/panel.js');
    return [[62.5, 65, 67.5], [-20, 0, 20], [0, 0.25, 0.5], [0, 0.2, 0.4]]
        .map((splits) => numberLabels(null, splits));
  });
  assert.deepEqual(labels, [['62.5', '65.0', '67.5'], ['−20', '0', '20'],
    ['0.00', '0.25', '0.50'], ['0.0', '0.2', '0.4']]);
  await close(page);
});

test('a history without episodes shows no empty tables and no odd axis',
    async () => {
      monitor.reset();
      monitor.answers.history = {episodes: [], more: false};
      monitor.answers.statistics = {per_day: [], valves: [], faults: [],
        labelled: {true: 0, false: 0, none: 0}, most_in_10_min: 0, gaps: []};
      const page = await openShared(browser, address, '#/history');
      await page.getByText('No episode fits the question.').waitFor();
      await page.locator('.bars').nth(1).waitFor();
      assert.equal(await page.locator('thead:visible').count(), 0);
      for (const text of await page.locator('.bars text').allTextContents()) {
        assert.doesNotMatch(text, /e/);
      }
      await close(page);
    });

test('groups have counts and select their valves', async () => {
  monitor.reset([tile('U1-FV-1', 'NORMAL'), tile('U1-FV-2', 'ISOLATED',
      ['f19']), tile('U2-LV-1A', 'NORMAL')]);
  const page = await openShared(browser, address, '#/');
  const group = page.getByLabel('Group');
  await group.waitFor();

  assert.deepEqual(await group.locator('option').allTextContents(),
      ['All groups (2)', 'U1-FV (2, 1 in alarm)', 'U2-LV (1)']);
  await group.selectOption('U2-LV');
  await until(async () => await page.locator('.tile').count() === 1, 'one');
  assert.match(page.url(), /group=U2-LV/);
  await close(page);
});

test('groups of the file come before the beginnings of ids', async () => {
  monitor.reset([tile('U1-FV-1', 'NORMAL'), tile('U1-FV-2', 'ISOLATED',
      ['f19']), tile('U2-LV-1', 'NOT_JUDGED', [], {active: true, fault: 'f6'}),
  tile('U3-PV-1', 'NORMAL')]);
  monitor.answers.groups = {groups: [
    {name: 'Boiler house', valves: ['U[12]-*']},
    {name: 'Air header', valves: ['U1-FV-2']}]};
  const page = await openShared(browser, address, '#/');
  const group = page.getByLabel('Group');
  await page.locator('.tile', {hasText: 'Boiler house'}).first().waitFor();

  assert.deepEqual(await group.locator('option').allTextContents(),
      ['All groups (3)', 'Air header (1, 1 in alarm)',
        'Boiler house (3, 2 in alarm)', 'U3-PV (1)']);
  await group.selectOption('Boiler house');
  await until(async () => await page.locator('.tile').count() === 3, 'three');
  await page.getByPlaceholder('Search').fill('air header');
  await until(async () => await page.locator('.tile').count() === 1, 'one');
  await close(page);
});

test('an alarm stays one while its valve is not judged', async () => {
  const episode = '0000000000000001';
  const held = {active: true, unacked: true, episode, fault: 'f19',
    severity: 'high', quality: 'SETTLING', reasons: 'waiting'};
  monitor.reset([tile('V', 'NOT_JUDGED', [], held),
    tile('W', 'NORMAL', [], {unacked: true}), tile('X', 'NORMAL')],
  [alarm(episode, 'V', 'f19')]);
  monitor.answers['valves/V/trend'] =
    trend({state: 'NORMAL', d0: 1, d: [0, 0]});
  const page = await openShared(browser, address, '#/');
  const said = page.locator('.tile', {hasText: 'Flow transmitter wrong'});
  await said.waitFor();

  assert.match(await said.innerText(), /not judged now[^]*settling/);
  assert.deepEqual(await page.locator('.tile .tile-id').allTextContents(),
      ['V', 'W', 'X']);
  await page.getByRole('button', {name: /In alarm 1/}).waitFor();
  // It has a name, though nobody judges it now: no question mark, and a check.
  assert.equal(await said.locator('.sign text').textContent(), '2');
  await page.goto(`${address}/#/valve/V`);
  await page.locator('.state-line')
      .getByText('Flow transmitter wrong (f19): not judged now').waitFor();
  await page.locator('.checks', {hasText: 'Compare it.'}).waitFor();
  assert.equal(await page.locator('.state-line .sign text').textContent(),
      '2');
  await close(page);
});

test('an alarm whose data ended stays, and can be shelved', async () => {
  // It is detected three hours ago and heard for an hour; it stands since then.
  const ended = {state: 'CLOSED', detected_ms: kNowMs - 3 * 3600000,
    ended_ms: kNowMs - 2 * 3600000, unconfirmed_ms: kNowMs - 2 * 3600000};
  monitor.reset([], [alarm('0000000000000001', 'V', 'f19', ended),
    alarm('0000000000000002', 'W', 'f19', {...ended, isa: 'RTN_UNACK',
      unconfirmed_ms: null, returned_ms: ended.ended_ms})]);
  Object.assign(monitor.answers.status, {write: true, user: 'anna'});
  const page = await openShared(browser, address, '#/alarms');
  const stands = page.locator('tr.group-UNACK',
      {hasText: 'not confirmed since'});
  await stands.getByRole('button', {name: 'Shelve V'}).waitFor();
  assert.match(await stands.innerText(), /3 h 0\d min/);
  assert.match(await page.locator('tr.group-RTN_UNACK').innerText(),
      /1 h 00 min/);
  assert.equal(await page.getByRole('button', {name: 'Shelve W'}).count(), 0);
  await close(page);
});

test('the legend says which rivals a name still has', async () => {
  monitor.reset([tile('V', 'ISOLATED', ['f19'])]);
  const data = trend({state: 'ISOLATED', d0: 0, d: [0.9, 0.5, 0.1]},
      {faults: ['f19', 'f6', 'f3']});
  data.d[2][0] = 1;  // It fitted before.
  monitor.answers['valves/V/trend'] = data;
  const page = await openShared(browser, address, '#/valve/V');
  const legend = page.locator('.panel', {hasText: 'How well'})
      .locator('.legend button');
  await legend.nth(3).waitFor();

  assert.deepEqual(await legend.evaluateAll((nodes) => nodes.map((node) =>
    [node.lastChild.textContent, node.className])), [['excluded', 'quiet'],
    ['explains it', 'strong'], ['not excluded', ''], ['excluded', 'quiet']]);
  await close(page);
});

test('work on a healthy valve is planned from a later time', async () => {
  monitor.reset([tile('V', 'NORMAL', [], {shelf_planned_ms: kNowMs + 60000})]);
  Object.assign(monitor.answers.status, {write: true, user: 'anna'});
  monitor.answers['valves/V/trend'] =
    trend({state: 'NORMAL', d0: 1, d: [0, 0]});
  const page = await openShared(browser, address, '#/valve/V');
  await page.locator('.state-line').getByText('shelf planned from').waitFor();
  await page.getByRole('button', {name: 'Shelve V'}).click();
  await page.getByLabel('From (empty: now)').fill('2031-05-06T07:08');
  await page.getByLabel('Reason').fill('overhaul');
  const [request] = await Promise.all([
    page.waitForRequest((each) => each.url().endsWith('/shelf')),
    page.getByRole('dialog').getByRole('button', {name: 'Shelve'}).click()]);

  assert.deepEqual(request.postDataJSON(), {valve: 'V', fault: null,
    minutes: 480, from_ms: new Date(2031, 4, 6, 7, 8).getTime(),
    comment: 'overhaul'});
  await close(page);
});

test('a narrow screen keeps what to check', async () => {
  monitor.reset([], [alarm('0000000000000001', 'V', 'f19',
      {check: 'Compare it.'})]);
  monitor.answers.worklist = {...kList, rows: [{...kWork, valve_id: 'V',
    check: 'Look here.'}]};
  const page = await openShared(browser, address, '#/alarms',
      {viewport: {width: 390, height: 800}});
  await page.getByText('Compare it.').waitFor();
  await page.goto(`${address}/#/worklist`);
  await page.getByText('Look here.').waitFor();

  for (const view of ['alarms', 'worklist', '']) {
    await page.goto(`${address}/#/${view}`);
    await page.locator('main h1').waitFor();
    assert.ok(await page.evaluate(() =>
      document.documentElement.scrollWidth <= innerWidth), view);
  }
  await close(page);
});

const kWork = {rank: 1, valve_id: kLongId, kind: 'episode', fault: 'f6',
  name: '<b>Plug worn', severity: 'high', severity_points: 4, grade: 1,
  grade_factor: 2, certainty: 'likely', confidence: 0.75, score: 6, open: true,
  look_alikes: ['f19'],
  unconfirmed_utc: null, shares: 'cause: air header',
  why: 'Plug worn: stands for 3 days, and it grows by 2 % a day',
  check: 'Look at it, and at what stands beside it; then compare it with ' +
    'another one of its kind.', discipline: 'mechanical|instrument',
  acked_by: 'anna', label: null, episode_id: '0000000000000001',
  in_work_utc: null, order: null, expected_utc: null};

const kList = {
  as_of_utc: '2026-11-25T12:00:00Z', since_utc: '2026-08-27T12:00:00Z',
  coverage: {loops: 3, named_faults: 1, audit: 1, nothing: 1},
  rows: [kWork, {...kWork, rank: 2, valve_id: 'W', open: false,
    in_work_utc: '2026-11-24T12:00:00Z', order: '4711',
    expected_utc: '2026-11-26T12:00:00Z'}],
  shared: [{shares: 'cause', group: 'air header', faults: ['f6'],
    since_utc: '2026-11-25T11:00:00Z', ended_utc: null,
    valve_ids: ['V', 'W']}],
  unjudged: [{valve_id: 'X', judged_share: 0.25, reason: 'no data came'}],
  done: [{valve_id: 'Y', fault: 'f19', name: 'Flow transmitter wrong',
    done_utc: '2026-11-24T12:00:00Z', who: 'bo', what: 'recalibrated'}],
  shelved: []};

test('the work list has the order of its document, factors, and what nobody ' +
  'judges', async () => {
  monitor.reset();
  monitor.answers.worklist = kList;
  const page = await openShared(browser, address, '#/worklist',
      {viewport: {width: 1900, height: 900}});
  await page.getByText('<b>Plug worn (f6)').first().waitFor();
  const text = await page.locator('main').innerText();
  for (const part of ['As of ', '2 of 3 loops are watched', 'high (×4)',
    '1 (×2.0)', 'likely (×0.75)', '6.00', 'shares cause: air header',
    'no data came', '25.0 %', 'mechanical or instrument', 'returned',
    'stands; acknowledged', 'in work, order 4711, expected back 2026-11-26',
    'Done, and watched for their return', 'recalibrated',
    '<b>Plug worn (f6) or Flow transmitter wrong (f19)']) {
    assert.ok(text.includes(part), part);
  }
  assert.deepEqual(await page.getByRole('table', {name: 'Work list'})
      .locator('tbody th').allInnerTexts(), [kLongId, 'W']);
  // A list without rows says if there was anything to find them in.
  const bare = {...kList, rows: []};
  for (const [coverage, said] of [[kList.coverage, 'Nothing to do: no valve'],
    [{loops: 2, named_faults: 0, audit: 0, nothing: 2}, 'Nothing was judged']]) {
    monitor.answers.worklist = {...bare, coverage};
    await page.getByRole('button', {name: 'Refresh'}).click();
    await page.locator('.nothing', {hasText: said}).waitFor();
  }
  await close(page);
});

test('the table of residuals says what is within, beyond and not judged',
    async () => {
      const data = trend({state: 'DETECTED', d0: 0, d: [0.5, 0.1]});
      const last = [2.6, -2.6, 0, null];
      data.channels = last.map((_, c) =>
        ({name: `C${c}`, unit: '', low: -2.5, high: 2.5}));
      data.residuals = last.map((value) => data.t_ms.map(() => value));
      data.windows = [{channel: 'C2', samples: 60, of: 'mean', value: 1,
        low: -0.5, high: 0.5}];
      monitor.reset([tile('V', 'DETECTED')]);
      monitor.answers['valves/V/trend'] = data;
      monitor.answers['valves/V/about'] = {type: null, service: null,
        description: null, location: null, document: null, grade: null,
        group: null, repairs: [{at_ms: kNowMs, kind: 'recalibrated', who: 'bo',
          note: null, order: null},
        {at_ms: kNowMs, kind: 'ordered', who: 'al', note: null, order: '7'},
        {at_ms: kNowMs + 1e9, kind: 'replaced', who: 'al', note: null,
          order: null}]};
      const page = await openShared(browser, address, '#/valve/V');
      const rows = page.locator('table', {hasText: 'Residuals now'})
          .locator('tbody tr');
      await rows.first().waitFor();
      assert.deepEqual(await rows.evaluateAll((all) => all.map((row) =>
        [row.cells[0].textContent, row.cells[3].textContent, row.className])),
      [['C0', 'above', 'out'], ['C1', 'below', 'out'], ['C2', 'within', ''],
        ['C2, mean over 60 samples', 'above', 'out'], ['C3', 'abstains', '']]);
      await page.getByText(/^Last work: recalibrated, .* by bo$/).waitFor();
      // Limits of 21 % would call anything within.
      await monitor.push('tiles', {tiles: [tile('V', 'DETECTED', [],
          {blind: true})]});
      await rows.filter({hasText: 'C2'})
          .getByText('within, but the limits are too wide').waitFor();
      await close(page);
    });

test('a valve says who it is, and links its data sheet only to the web',
    async () => {
      const about = (document) => ({description: '<i>Feed</i>', service: 'F',
        location: 'Hall 2', document, grade: 1});
      monitor.reset([tile('V', 'NORMAL')], [
        alarm('0000000000000001', 'V', 'f19', {about: about('https://d/1')})]);
      monitor.answers.worklist = {...kList, rows: [
        {...kList.rows[0], about: about('DS-1')}]};
      monitor.answers['valves/V/about'] = about('javascript:alert(1)');
      monitor.answers['valves/V/trend'] =
          trend({state: 'NORMAL', d0: 1, d: [0, 0]});
      const page = await openShared(browser, address, '#/alarms');
      const head = page.locator('tbody th').first();
      await head.getByText('<i>Feed</i>').waitFor();
      await head.getByText('Hall 2').waitFor();
      await page.goto(`${address}/#/worklist`);
      await head.getByText('<i>Feed</i>').waitFor();
      await page.goto(`${address}/#/valve/V`);
      await page.getByText('Feed</i>, Hall 2, data sheet javascript:').waitFor();
      assert.equal(await page.locator('a[href^="javascript"]').count(), 0);
      await close(page);
    });

test('alarms stand in the order of the work list, and say as of when',
    async () => {
      monitor.reset([], [
        alarm('0000000000000001', 'Low', 'f6', {score: 1, severity: 'high'}),
        alarm('0000000000000002', 'Most', 'f19', {score: 8, severity: 'low'}),
        alarm('0000000000000003', 'Seen', 'f19', {score: 9, isa: 'ACKED'}),
        alarm('0000000000000004', 'Gone', 'f19', {score: 16, isa: 'RTN_UNACK',
          returned_ms: kNowMs}),
        alarm('0000000000000005', 'Aside', 'f19', {score: 16,
          shelved: {until_ms: kNowMs, who: 'jan', comment: ''}})]);
      const page = await openShared(browser, address, '#/alarms');
      await page.locator('tbody tr').first().waitFor();
      assert.deepEqual(await page.locator('tbody th').allInnerTexts(),
          ['Seen', 'Most', 'Low', 'Gone', 'Aside']);
      await page.getByText(/^As of /).waitFor();
      await close(page);
    });

test('a valve page says what judges it and what that cannot see', async () => {
  monitor.reset([tile('V', 'NORMAL', [], {missing: ['P1']})]);
  monitor.answers.status.model_sets = [{model_set: 'm@1',
    faults: ['f19'], undetectable: ['f19']}];
  monitor.answers['valves/V/about'] = {type: 'globe DN100', service: 'L',
    grade: 1, group: null};
  monitor.answers['valves/V/trend'] = {...trend({state: 'DETECTED', d0: 0.97,
    d: [1, 0.99]}), windows: [{channel: 'F', samples: 120, of: 'mean',
    value: -0.31, low: -0.1, high: 0.1}]};
  const page = await openShared(browser, address, '#/valve/V');

  // A slow fault shows in a window, while each residual is within.
  await page.locator('tr.out', {hasText:
    /F \[m³\/h\], mean over 120 samples.*−0.31.*−0.1\d* … 0.1\d*.*below/}).waitFor();
  await page.getByText('Service: level, globe DN100, grade 1. Judged by model set m@1, without P1. Faults ' +
    'that it cannot name: Plug worn. Faults that look normal to it: ' +
    'Flow transmitter wrong.').waitFor();
  await close(page);
});

test('an interval without width is never shown', async () => {
  const row = alarm('0000000000000001', 'V', 'f19',
      {lowest: 0.496, highest: 0.504, worst_strength: 0.5});
  monitor.reset([], [row]);
  monitor.answers[`episodes/${row.episode}`] = {episode: row, events: [],
    trace: null, model_hash: 'x', look: {misfit: 1, faults: [{fault: 'f19',
      strength: 0.5, lowest: 0.499, highest: 0.501, begins_ms: kNowMs,
      growing: false}]}, growth: [{fault: 'f19', strength: 0.5, lowest: 0.5,
      highest: 0.5, rate: null, full_in_ms: null, at_ms: kNowMs}]};
  const page = await openShared(browser, address, `#/episode/${row.episode}`);
  await page.locator('.growth').waitFor();

  assert.doesNotMatch(await page.locator('.episode').innerText(),
      /50 % to 50 %/);
  await close(page);
});

/** Nothing of `page` is cut, wider than the window, or too pale to be read. */
async function checkReadable(page, where, colours = true) {
  for (const scheme of colours ? ['light', 'dark'] : []) {
    await setScheme(page, scheme);
    const faults = await accessibilityFaults(page, scheme === 'dark');
    assert.deepEqual(faults, [], `${where} ${scheme}`);
  }
  const cut = await page.locator('.tile-how, .tile-what, .tile-quality, .tag')
      .evaluateAll((nodes) => nodes.filter((node) =>
        node.scrollHeight > node.clientHeight + 3)
          .map((node) => node.textContent));
  assert.deepEqual(cut, [], where);
  assert.ok(await page.evaluate(() =>
    document.documentElement.scrollWidth <= innerWidth), where);
  const wide = await page.locator('.table-box, dialog').evaluateAll((nodes) =>
    nodes.filter((node) => node.scrollWidth > node.clientWidth)
        .map((node) => node.textContent));
  assert.deepEqual(wide, [], where);
}

test('what came on top of a fault is named wherever the fault is', async () => {
  const episode = '0000000000000001';
  monitor.reset([tile('V', 'ISOLATED', ['f19'], {episode, second: 'f1'}),
    tile('W', 'ISOLATED', ['f6'], {second: 'unknown'})],
  [alarm(episode, 'V', 'f19', {second: 'f1'})]);
  monitor.answers.status.write = true;
  const page = await openShared(browser, address, '#/');
  await page.locator('.tile', {hasText: 'V'}).getByText(/, and f1$/).waitFor();
  await page.locator('.tile', {hasText: 'W'})
      .getByText(/, and a second fault without a name$/).waitFor();

  await page.goto(`${address}/#/alarms`);
  await page.locator('.fault', {hasText: /, and f1/}).waitFor();
  await page.getByRole('button', {name: 'Acknowledge V'}).click();

  await page.getByRole('dialog').getByText(/^V: .*, and f1$/).waitFor();
  await close(page);
});

test('a click counts though the list is made anew while it is pressed',
    async () => {
      const rows = ['1', '2'].map((n) => alarm(`000000000000000${n}`, `V${n}`,
          'f19', {state: 'ISOLATED'}));
      monitor.reset([], rows);
      Object.assign(monitor.answers.status,
          {write: true, user: 'anna', role: 'engineer'});
      const page = await openShared(browser, address, '#/alarms');
      const press = async (name) => {
        await page.getByRole('button', {name, exact: true}).hover();
        await page.mouse.down();
      };

      await press('Shelve V2');
      await monitor.push('alarm', {...rows[0], label: 'f18'});
      await page.evaluate(() => new Promise((done) => setTimeout(done, 200)));
      await page.mouse.up();
      await page.getByRole('dialog').waitFor({timeout: 5000});
      await page.keyboard.press('Escape');

      // Nor does a press that never ends hold the list up.
      await press('Shelve V2');
      await monitor.push('alarm', alarm('0000000000000003', 'V3', 'f18'));
      await page.locator('tr', {hasText: 'V3'}).waitFor({timeout: 5000});
      await page.mouse.up();
      await close(page);
    });

test('paper is light, has no buttons, and shows every column and plot whole',
    async () => {
      const episode = '0000000000000001';
      monitor.reset([tile('V', 'ISOLATED', ['f19'])],
          [alarm(episode, 'V', 'f19', {check: kWork.check})]);
      Object.assign(monitor.answers.status,
          {write: true, user: 'anna', role: 'engineer'});
      monitor.answers.worklist = kList;
      monitor.answers[`episodes/${episode}`] = {episode: alarm(episode, 'V',
          'f19'), model_hash: '0123456789abcdef', events: [], look: null,
      growth: [], trace: {...trend({state: 'ISOLATED', d0: 0, d: [1, 0.4]}),
        valve: 'V'}};
      const page = await openShared(browser, address, '#/alarms',
          {viewport: {width: 1400, height: 900}});
      await setScheme(page, 'dark');
      for (const [hash, seen, layout] of [['alarms', 'tbody tr', 'landscape'],
        ['worklist', 'tbody tr', 'landscape'],
        [`episode/${episode}`, '.panel canvas', 'portrait']]) {
        await page.goto(`${address}/#/${hash}`);
        await page.locator(seen).first().waitFor();
        const columns = await page.locator('thead th:not(.for-hand)').count();
        // Between the margins of A4, at 96 pixels an inch.
        const width = layout === 'landscape' ? 1047 : 718;
        await page.setViewportSize({width, height: 900});
        await page.emulateMedia({media: 'print', colorScheme: 'dark'});
        await page.evaluate(() => dispatchEvent(new Event('beforeprint')));
        const paper = await page.evaluate(() => ({
          theme: document.documentElement.dataset.theme,
          page: getComputedStyle(document.querySelector('main')).page,
          ground: getComputedStyle(document.documentElement).backgroundColor,
          printed: document.querySelector('main').dataset.printed,
          buttons: [...document.querySelectorAll('button, a.button, input')]
              .filter((node) => !node.closest('.legend') &&
                node.checkVisibility()).map((node) => node.textContent),
          columns: [...document.querySelectorAll('thead th')].filter((node) =>
            node.checkVisibility() &&
            node.getBoundingClientRect().right <= innerWidth + 1).length,
          plots: [...document.querySelectorAll('.panel canvas')].filter(
              (node) => node.getBoundingClientRect().right >
                innerWidth).length}));
        assert.match(paper.printed, /^Printed \d{4}-\d\d-\d\d \d\d:/, hash);
        delete paper.printed;
        assert.deepEqual(paper, {theme: 'light', ground: 'rgb(255, 255, 255)',
          page: layout === 'landscape' ? 'list' : 'auto', buttons: [],
          columns, plots: 0}, hash);
        await page.evaluate(() => dispatchEvent(new Event('afterprint')));
        await page.emulateMedia({media: 'screen', colorScheme: 'dark'});
        await page.setViewportSize({width: 1400, height: 900});
        assert.equal(await page.evaluate(() =>
          document.documentElement.dataset.theme), 'dark');
      }
      await close(page);
    });

test('every kind of tile can be read, at any size, light and dark',
    async () => {
      const episode = '0000000000000001';
      const named = {episode, since_ms: kNowMs, strength: 0.5, unacked: true,
        severity: 'critical'};
      monitor.reset([tile('FV-1', 'ISOLATED', ['f19', 'f6'],
          {...named, certainty: 'one of', spark: [0, 1]}),
      tile('FV-2', 'DETECTED', [], {certainty: 'not yet', since_ms: kNowMs}),
      tile('FV-3', 'PARTLY_JUDGED', [], {missing: ['P1'], unjudged: ['F']}),
      tile('FV-4', 'NOT_JUDGED', [], {quality: 'STALE', stamp_ms: 1}),
      tile('FV-6', 'NOT_JUDGED', [], {quality: 'SETTLING', active: true,
        reasons: 'waiting', fault: 'f19|f6', since_ms: 1, strength: 0.5}),
      tile('LV-5', 'NORMAL'), tile('LV-7', 'NORMAL', [], {notice: true})],
      [alarm(episode, 'FV-1', 'f19|f6', {label: 'f6', check: 'Look.'}),
        alarm('0000000000000002', kLongId, 'f19|f6', {label: 'f6',
          check: kWork.check})]);
      monitor.answers.worklist = kList;
      monitor.answers['valves/FV-1/trend'] = trend({state: 'ISOLATED', d0: 0,
        d: [1, 0.4], residual: -76.6});
      Object.assign(monitor.answers.status,
          {write: true, user: 'anna', role: 'engineer'});
      for (const [width, height] of [[1400, 900], [1280, 800], [390, 800]]) {
        const page = await openShared(browser, address, '#/',
            {viewport: {width, height}});
        for (const hash of ['#/', '#/alarms', '#/valve/FV-1', '#/worklist']) {
          await page.goto(`${address}/${hash}`);
          await page.locator('main :is(.tile, tbody tr, .panel)').first()
              .waitFor();
          await checkReadable(page, `${hash} ${width}`, width !== 1280);
          // Nor may what stands on top take a second line.
          for (const part of width < 1000 ? [] :
            await page.locator('.top, .plant .controls').all()) {
            assert.ok((await part.boundingBox()).height < 60, `${hash} ${width}`);
          }
          // Nor may a text be squeezed to a column of words.
          for (const cell of await page.locator('td.check').all()) {
            assert.ok((await cell.boundingBox()).width > 250, hash);
          }
          // Buttons must be in sight without scrolling.
          const hidden = await page.locator('.row-actions button')
              .evaluateAll((nodes) => nodes.filter((node) =>
                node.getBoundingClientRect().right > innerWidth)
                  .map((node) => node.textContent));
          assert.deepEqual(hidden, [], `${hash} ${width}`);
        }
        await close(page);
      }
    });

test('every other view and dialog can be read, at any size, light and dark',
    async () => {
      const row = alarm('0000000000000001', kLongId, 'f19|f6', {
        certainty: 'one of', lowest: 0.4, highest: 0.6, worst_strength: 0.7,
        discipline: 'mechanical|instrument', acked_by: 'anna', isa: 'ACKED',
        acked_ms: kNowMs, isolated_ms: kNowMs + 60000, layer: 'physics',
        check: kWork.check});
      const early = alarm('0000000000000002', 'V', 'unknown', {
        certainty: 'not yet', state: 'CLOSED', isa: 'RTN_UNACK',
        name: 'Fault that ended before it had a name'});
      const shelf = {shelf_id: 1, until_ms: kNowMs + kDayMs, who: 'bo',
        comment: 'overhaul of the whole line, ordered'};
      const event = (kind, more) => ({kind, at_ms: kNowMs, faults: '',
        strength: null, layer: null, reason: null, value: null, comment: null,
        who: null, origin: null, ...more});
      monitor.reset([tile(kLongId, 'ISOLATED', ['f19', 'f6'],
          {monitor: 'host-a:1', episode: row.episode}),
      tile('V', 'NOT_JUDGED', [], {quality: 'MONITOR_SILENT',
        monitor: 'host-b:4711', monitor_silent_since_ms: kNowMs - kDayMs})],
      [row, early, alarm('0000000000000003', 'W', 'f6', {shelved: shelf})]);
      Object.assign(monitor.answers.status,
          {write: true, user: 'anna', role: 'engineer'});
      monitor.answers.history = {episodes: [row, early], more: true};
      monitor.answers.statistics = {
        per_day: [0, 3, 9].map((n) => ({episodes: n, alarm_s: 900 * n,
          day: new Date(kNowMs - n * kDayMs).toISOString().slice(0, 10)})),
        valves: [{valve: kLongId, episodes: 12, open: 1, alarm_s: 10800,
          chattering: 3, standing: 1, last_ms: kNowMs}],
        faults: [{fault: 'f19', name: 'n', episodes: 9, right: 2, wrong: 1},
          {fault: 'unknown', name: 'Without a name', episodes: 3, right: 0,
            wrong: 0}],
        labelled: {true: 2, false: 1, none: 9}, most_in_10_min: 4,
        gaps: [{from_ms: kNowMs - 60000, to_ms: kNowMs}]};
      monitor.answers.worklist = kList;
      monitor.answers[`episodes/${row.episode}`] = {episode: row,
        model_hash: '0123456789abcdef', trace: {...trend({state: 'ISOLATED',
          d0: 0, d: [1, 0.4]}), valve: kLongId},
        events: [event('DETECTED'), event('ISOLATED', {faults: 'f19|f6',
          strength: 0.5, layer: 'physics'}), event('ACK', {who: 'anna',
          origin: 'console 127.0.0.1', comment: shelf.comment})],
        look: {misfit: 1, faults: [{fault: 'f19', strength: 0.5, lowest: 0.4,
          highest: 0.6, begins_ms: kNowMs, growing: true}]},
        growth: [{fault: 'f19', strength: 0.5, lowest: 0.4, highest: 0.6,
          rate: {value: 0.1, lowest: 0.05, highest: 0.2},
          full_in_ms: {value: 5 * kDayMs, lowest: 3 * kDayMs,
            highest: 9 * kDayMs}, at_ms: kNowMs}]};
      const plant = {history_away: null, monitors: [
        {monitor: 'host-a:1', host: 'host-a', software: '0', health: 'OK',
          text: '', valves: 1, heard_ms: kNowMs, silent: false},
        {monitor: 'host-b:4711', host: 'host-b', software: '0',
          health: 'DEGRADED', text: 'the history does not respond',
          valves: 1, heard_ms: kNowMs - kDayMs, silent: true}]};
      for (const [width, height] of [[1400, 900], [390, 800]]) {
        const page = await openShared(browser, address, '#/',
            {viewport: {width, height}});
        for (const [hash, seen] of [['#/history', '.figures'],
          [`#/episode/${row.episode}`, '.panel'], ['#/worklist', 'tbody tr']]) {
          await page.goto(`${address}/${hash}`);
          await page.locator(seen).first().waitFor();
          await checkReadable(page, `${hash} ${width}`);
          for (const text of await page.locator('.bars text').all()) {
            assert.ok((await text.boundingBox()).height >= 9, hash);
          }
          if (width === 390) continue;
          await page.setViewportSize({width: 1280, height});
          await checkReadable(page, `${hash} 1280`, false);
          await page.setViewportSize({width, height});
        }
        await page.goto(`${address}/#/alarms`);
        for (const name of [`Shelve ${kLongId}`, 'Label V', 'Shortcuts']) {
          if (name === 'Shortcuts') await page.keyboard.press('?');
          else await page.getByRole('button', {name, exact: true}).click();
          const dialog = page.getByRole('dialog');
          await dialog.waitFor();
          await checkReadable(page, `${name} ${width}`, width === 390);
          const box = await dialog.boundingBox();
          assert.ok(box.x >= 0 && box.y >= 0 && box.x + box.width <= width &&
            box.y + box.height <= height, name);
          await page.keyboard.press('Escape');
          await dialog.waitFor({state: 'detached'});
        }
        monitor.answers.status.plant = plant;
        await page.goto(`${address}/#/`);
        await page.reload();
        await page.locator('.monitors tbody tr').first().waitFor();
        await checkReadable(page, `plant ${width}`);
        monitor.answers.status.plant = null;
        await close(page);
      }
    });
