// Tables that leave the page: no browser needed.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {csvOf} from '../../console/web/js/csv.js';

test('CSV has no formulas, and quotes only where it must', () => {
  const rows = ['=1+1', '+1+1', '-cmd', '@SUM(A1)', '\'=1', '-1.5', 'V, "1"',
    'plain', null, -2].map((id) => ({id}));

  assert.equal(csvOf(['id'], rows), [
    'id', '\'=1+1', '\'+1+1', '\'-cmd', '\'@SUM(A1)', '\'\'=1', '-1.5',
    '"V, ""1"""', 'plain', '', '-2', ''].join('\n'));
});
