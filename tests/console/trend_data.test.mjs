// The columns of a trend, and the parser of the stream: no browser needed.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {TrendData}
  from '../../console/web/js/charts/trend_data.js';

function trend(times, extra = {}) {
  return {
    model_set: 'a@1', channels: [{name: 'X', unit: '%', low: -1, high: 1}],
    faults: ['f1'], T: 0.75, t_ms: [...times], x: times.map((t) => t / 1000),
    residuals: [times.map(() => 0.5)], d0: times.map(() => 1),
    d: [times.map(() => 0)], state: times.map(() => 'NORMAL'),
    quality: times.map(() => 'LIVE'), gaps: [], marks: [], words: '', ...extra,
  };
}

function seconds(from, to) {
  return Array.from({length: to - from}, (_, i) => 1000 * (from + i));
}

test('what a restarted monitor no longer has stays', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 60)), false);

  data.load(trend(seconds(80, 90)), true);

  assert.equal(data.size, 70);
  assert.equal(data.columns.t[59], 59000);
  assert.equal(data.columns.t[60], 80000);
});

test('an empty trend after a restart takes nothing away', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 60)), false);

  data.load(trend([]), true);

  assert.equal(data.size, 60);
});

test('what both have is there once', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 60)), false);

  data.load(trend(seconds(30, 70)), true);
  data.append([{t_ms: 69000}, {t_ms: 70000, x: 1, residuals: [0], d: [0]}]);

  assert.deepEqual(data.columns.t, seconds(0, 71));
});

test('samples that come again are told from a clock that was set back', () => {
  const data = new TrendData();
  data.load(trend(seconds(30, 60)), false);

  assert.ok(!data.goesBack([{t_ms: 58000}, {t_ms: 59000}, {t_ms: 60000}]));
  assert.ok(data.goesBack([{t_ms: 60000}, {t_ms: 20000}]));
});

test('another model set begins anew', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 60)), false);

  data.load(trend(seconds(80, 90), {model_set: 'b@1'}), true);

  assert.equal(data.size, 10);
});

test('a gap breaks the lines and takes the reason that was given', () => {
  const data = new TrendData();
  const gap = {from_ms: 9500, to_ms: 29000, reason: 'monitor was down'};
  data.load(trend([...seconds(0, 10), ...seconds(30, 40)], {gaps: [gap]}),
      false);

  const gaps = data.allGaps();
  const table = data.table(gaps);

  assert.deepEqual(gaps, [
    {from_ms: 9000, to_ms: 30000, reason: 'monitor was down'}]);
  assert.equal(table.t.length, 21);
  assert.equal(table.t[10], 19500);
  assert.equal(table.x[10], null);
  assert.equal(table.x[11], 30);
});

test('factors of faults are drawn while an episode is open', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 3), {
    d: [[0.9, 0.8, 0.7]], state: ['NORMAL', 'DETECTED', 'ISOLATED']}), false);

  assert.deepEqual(data.table([]).d1, [null, 0.8, 0.7]);
  assert.deepEqual(data.columns.d1, [0.9, 0.8, 0.7]);
});

test('the expected value is the measured one without the residual', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 3)), false);

  assert.deepEqual(data.table([]).x_hat, [-0.5, 0.5, 1.5]);
});

test('a PV is kept with its set point, and is null before', () => {
  const data = new TrendData();
  data.load(trend(seconds(0, 3)), false);
  data.append([{t_ms: 3000, pv: 3.25, sp: 3.5, residuals: [0], d: [0]}]);
  assert.deepEqual(data.columns.pv, [null, null, null, 3.25]);
  assert.deepEqual(data.columns.sp, [null, null, null, 3.5]);
  assert.ok(data.has('pv'));
});
