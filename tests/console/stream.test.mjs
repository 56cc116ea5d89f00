// The parser of server-sent events: no browser needed.

import assert from 'node:assert/strict';
import {test} from 'node:test';

import {EventParser} from '../../console/web/js/stream.js';

test('events come whole from pieces', () => {
  const parser = new EventParser();

  assert.deepEqual(parser.push('event: hello\nda'), []);
  assert.deepEqual(parser.push('ta: {"a":1}\n\nevent: gap\ndata: 2\n'),
      [{type: 'hello', data: '{"a":1}'}]);
  assert.deepEqual(parser.push('\n'), [{type: 'gap', data: '2'}]);
});

test('pings are no events', () => {
  assert.deepEqual(new EventParser().push(': ping\n\n'), []);
});
