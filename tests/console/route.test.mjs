// Links of the page: no browser needed.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {link, parseRoute} from '../../console/web/js/route.js';

test('a link leads back to where it came from', () => {
  const {name, id, query} =
      parseRoute(link('valve', 'area 1/FV"1%?', {from: 1, until: null}));

  assert.deepEqual([name, id], ['valve', 'area 1/FV"1%?']);
  assert.equal(String(query), 'from=1');
});

test('a link that was cut in the middle of a letter is no error', () => {
  assert.equal(parseRoute('#/valve/%E0%A4%A').id, '%E0%A4%A');
});
