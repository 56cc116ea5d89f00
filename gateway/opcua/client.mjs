// From an OPC UA server to readings on stdout, a line each, for all tags of a
// plant table: the source of `fdi-gateway in --lines -`. docs/connect.md.
//
//     node client.mjs plant.toml --endpoint opc.tcp://HOST:4840 |
//       fdi-gateway in --plant plant.toml --lines -
//
// The server is subscribed to, so what happens between two publications waits
// in its queues. While the subscription lives, what is not mentioned has not
// changed, which "alive" says. When it ends, every tag is bad until the server
// has told of it again.
import {execFileSync} from 'node:child_process';
import {parseArgs} from 'node:util';

console.log = console.error;  // The library talks there; stdout has readings.
const opcua = await import('node-opcua-client');
const {OPCUACertificateManager} = await import('node-opcua-certificate-manager');

const usage = 'usage: client.mjs PLANT.toml --endpoint opc.tcp://HOST:PORT ' +
  '[--node "ns=1;s={tag}"] [--user NAME] [--security Basic256Sha256] ' +
  '[--interval MS] [--stamps source|server] [--pki FOLDER]';
const {values: options, positionals} = parseArgs({allowPositionals: true,
  options: {
    endpoint: {type: 'string'},
    // {tag} is the tag of the table; nsu=URI; instead of ns=N; survives a
    // server that numbers its namespaces otherwise.
    node: {type: 'string', default: 'ns=1;s={tag}'},
    user: {type: 'string'},
    security: {type: 'string'},
    interval: {type: 'string', default: '250'},
    stamps: {type: 'string', default: 'source'},
    pki: {type: 'string', default: `${process.env.FDI_DATA ?? 'fdi-data'}/opcua-client`},
  }});
if (positionals.length !== 1 || !options.endpoint) {
  console.error(usage);
  process.exit(2);
}
const intervalMs = Number(options.interval);
const silenceMs = 10_000;      // Then the connection is given up.
const itemsAtOnce = 1000;      // In one request; servers limit them.
const wait = seconds => new Promise(resolve => { setTimeout(resolve, 1000 * seconds); });
const say = text => console.error(`opcua_client: ${text}`);
const count = {readings: 0, bad: 0, overflows: 0, reconnects: 0};

let stop, why;
const stopped = new Promise(resolve => { stop = reason => resolve(why = reason); });
for (const signal of ['SIGTERM', 'SIGINT']) process.on(signal, () => stop('stopped'));
process.stdout.on('error', () => stop('nobody reads the readings'));
let reload = () => {};
process.on('SIGHUP', () => reload('the table is read again'));
// The library throws beside all promises when a session ends while it subscribes.
process.on('uncaughtException', error => reload(error.message.split('\n')[0]));

// One program reads the table, so that a tag here is a tag there.
function readTags() {
  return execFileSync(process.env.FDI_GATEWAY ?? 'fdi-gateway',
    ['in', '--plant', positionals[0], '--tags'], {encoding: 'utf8', stdio: ['ignore', 'pipe', 'inherit']})
    .split('\n').filter(tag => tag !== '');
}

// Whoever reads slower than the server tells holds the server's queues up.
let drained = Promise.resolve();
function write(lines) {
  if (lines.length > 0 && !process.stdout.write(lines.join('\n') + '\n'))
    drained = new Promise(resolve => process.stdout.once('drain', resolve));
}

let newestMs = 0;   // Stamp of the newest reading.
let saidAt = 0;     // When it came, by performance.now().

function lineOf(tag, {statusCode, value, sourceTimestamp, serverTimestamp}) {
  if (statusCode.hasOverflowBit) ++count.overflows;
  const stamp = (options.stamps === 'server' ? null : sourceTimestamp) ?? serverTimestamp;
  if (stamp && Number(stamp) > newestMs) newestMs = Number(stamp), saidAt = performance.now();
  let reading = value?.value;
  // 64-bit integers are pairs of 32 bits, the high ones first.
  if ([opcua.DataType.Int64, opcua.DataType.UInt64].includes(value?.dataType)) {
    const bits = BigInt(reading[0]) << 32n | BigInt(reading[1]);
    reading = Number(value.dataType === opcua.DataType.Int64 ? BigInt.asIntN(64, bits) : bits);
  }
  const quality = statusCode.isGoodish() ? 'good' :
    statusCode.name.startsWith('Uncertain') ? 'uncertain' : 'bad';
  const usable = quality !== 'bad' && ['number', 'string', 'boolean'].includes(typeof reading) &&
    (typeof reading !== 'number' || Number.isFinite(reading));
  ++count[usable ? 'readings' : 'bad'];
  return JSON.stringify({tag, t: stamp?.toISOString(), v: usable ? reading : undefined,
    q: usable ? quality : 'bad'});
}

// nsu=URI;s=NAME becomes ns=N;s=NAME of this session.
async function nodeOf(session) {
  const [, uri, rest] = options.node.match(/^nsu=([^;]+);(.*)$/) ?? [];
  if (!uri) return options.node;
  const index = (await session.readNamespaceArray()).indexOf(uri);
  if (index < 0) throw Error(`the server has no namespace ${uri}`);
  return `ns=${index};${rest}`;
}

// Subscribes to all tags; one that the server refuses is said and bad.
async function subscribe(session, tags, heard) {
  const pattern = await nodeOf(session);
  const subscription = await session.createSubscription2({
    requestedPublishingInterval: intervalMs, requestedMaxKeepAliveCount: 4,
    requestedLifetimeCount: 100, publishingEnabled: false});
  const byHandle = new Map(), refused = [];
  subscription.on('raw_notification', ({notificationData}) => {
    heard();
    const items = (notificationData ?? []).flatMap(data => data.monitoredItems ?? []);
    // The server lists them by tag; what is older is said first.
    const stampOf = ({value}) => Number(value.sourceTimestamp ?? value.serverTimestamp);
    const lines = items.filter(item => byHandle.has(item.clientHandle))
      .sort((a, b) => stampOf(a) - stampOf(b))
      .map(item => lineOf(byHandle.get(item.clientHandle), item.value));
    if (lines.length === 0 && newestMs > 0) {
      const now = newestMs + performance.now() - saidAt;
      lines.push(JSON.stringify({alive: new Date(now).toISOString()}));
    }
    // In the time of the server: a later stamp would end the wait for its readings.
    if (newestMs > 0)
      lines.push(...refused.splice(0).map(tag => JSON.stringify({tag, t: new Date(newestMs), q: 'bad'})));
    write(lines);
  });
  for (let begin = 0; begin < tags.length; begin += itemsAtOnce) {
    const some = tags.slice(begin, begin + itemsAtOnce);
    const group = await subscription.monitorItems(
      some.map(tag => ({nodeId: pattern.replaceAll('{tag}', tag), attributeId: opcua.AttributeIds.Value})),
      {samplingInterval: intervalMs, queueSize: 1000, discardOldest: true},
      opcua.TimestampsToReturn.Both);
    group.monitoredItems.forEach((item, i) => {
      if (item.statusCode.isGoodish())
        byHandle.set(item.monitoringParameters.clientHandle, some[i]);
      else
        refused.push(some[i]), say(`tag ${some[i]}: ${item.statusCode.name}`);
    });
  }
  if (byHandle.size === 0) throw Error('the server has none of the tags');
  await subscription.setPublishingMode(true);
  say(`${byHandle.size} of ${tags.length} tags`);
  return subscription;
}

// Until the connection ends. @returns whether there was any.
async function follow(tags) {
  const client = opcua.OPCUAClient.create({
    applicationName: 'fdi gateway', endpointMustExist: false,
    connectionStrategy: {maxRetry: 0},
    // A server is who somebody has trusted; the default of the library trusts anybody.
    clientCertificateManager: options.security && new OPCUACertificateManager({
      rootFolder: options.pki, automaticallyAcceptUnknownCertificate: false}),
    securityMode: opcua.MessageSecurityMode[options.security ? 'SignAndEncrypt' : 'None'],
    securityPolicy: opcua.SecurityPolicy[options.security ?? 'None'],
  });
  let end;
  const ended = new Promise(resolve => { end = reload = resolve; });
  for (const event of ['connection_lost', 'close', 'abort'])
    client.on(event, () => end('the connection is lost'));
  let watchdog;
  const heard = () => {
    clearTimeout(watchdog);
    watchdog = setTimeout(end, silenceMs, 'the server is silent');
  };
  heard();
  let subscribed = false;
  const read = async () => {
    await client.connect(options.endpoint);
    const session = await client.createSession(options.user && {
      type: opcua.UserTokenType.UserName, userName: options.user,
      password: process.env.OPCUA_PASSWORD});
    const subscription = await subscribe(session, tags, heard);
    subscription.on('terminated', () => end('the subscription has ended'));
    subscribed = true;
  };
  const reason = await Promise.race([ended, stopped,
    read().then(() => ended, error => error.message.split('\n')[0])]);
  clearTimeout(watchdog);
  await Promise.race([client.disconnect().catch(() => {}), wait(2)]);
  say(`${reason}; ${Object.entries(count).map(([what, n]) => `${n} ${what}`).join(', ')}`);
  if (subscribed) {
    // Nothing of it is held over the gap; a stamp behind the last reading.
    const t = newestMs > 0 ? new Date(newestMs + 1).toISOString() : undefined;
    write(tags.map(tag => JSON.stringify({tag, t, q: 'bad'})));
  }
  return subscribed;
}

try {
  for (let pauseS = 1; !why; pauseS = Math.min(60, 2 * pauseS)) {
    if (await follow(readTags())) pauseS = 1, ++count.reconnects;
    await Promise.race([stopped, wait(pauseS)]);
  }
} catch (error) {  // A table that cannot be read.
  stop(error.message.split('\n')[0]);
  say(why);
}
await Promise.race([drained, wait(1)]);
process.exit(why === 'stopped' ? 0 : 1);
