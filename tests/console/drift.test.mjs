// What the page says of limits that followed a drift: no browser needed.

import assert from 'node:assert/strict';
import {test} from 'node:test';

globalThis.matchMedia = () => ({addEventListener() {}});  // Of the settings.
const {driftLines} = await import('../../monitor/console/web/js/drift.js');

const still = {channel: 'X', unit: '%', mean: 0, mean_bound: 1.1, mean_used: 0,
  mean_full_since_ms: null, scale: 1, scale_bound: 3, scale_used: 0,
  scale_full_since_ms: null};

test('limits that moved by a tenth of their bound or less are not told', () => {
  assert.deepEqual(driftLines([still, {...still, mean: 0.11, mean_used: 0.1}]),
      []);
});

test('each mean and scale that moved is a sentence', () => {
  const drift = [
    {...still, mean: 0.418, mean_used: 0.38},
    {...still, channel: 'F', unit: 'm³/h', mean: -0.2, mean_bound: -0.6,
      mean_used: 0.333, scale: 1.5, scale_used: 0.369}];

  assert.deepEqual(driftLines(drift), [
    'Limits of X have followed a drift of +0.418 % (at most 1.10 %).',
    'Limits of F have followed a drift of −0.200 m³/h (at most 0.600 m³/h).',
    'Limits of F are 1.50 times as wide as trained, because its noise has ' +
    'grown (at most 3.00 times).']);
});

test('a drift at its bound is told with the time it came there', () => {
  const [line] = driftLines([{...still, mean: 1.1, mean_used: 1,
    mean_full_since_ms: Date.UTC(2026, 10, 20, 12)}]);

  assert.match(line, /^Limits of X .* \(at most 1\.10 %\)\. They have been at /);
  assert.match(line, /since 2026-11-20 ..:..:..; a drift beyond it raises an/);
});
