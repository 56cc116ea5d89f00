// Clients of server.mjs, as opcua.sh calls them. Usage:
//     opcua.mjs PORT read NODE...           values and status codes
//     opcua.mjs PORT follow NODE SECONDS    each value that DeviceHealth takes
//     opcua.mjs PORT await NODE VALUE       within 60 s
//     opcua.mjs PORT acknowledge VALVE      prints when it called [ms since 1970]
//     opcua.mjs PORT hostile VALVE          what no client may do
// NODE is a name in the namespace of the valves.
import assert from 'node:assert/strict';
import {existsSync} from 'node:fs';
import {setTimeout as wait} from 'node:timers/promises';

const print = console.log;
console.log = console.error;
const {default: opcua} = await import('node-opcua-client');
const {AttributeIds, DataType, StatusCodes} = opcua;
const [port, verb, ...args] = process.argv.slice(2);
const patienceMs = 60_000;

// With OPCUA_PKI encrypted, with a certificate that is made there; OPCUA_EXPIRED:
// one of 2020.
async function secured() {
  const {OPCUACertificateManager} = await import('node-opcua-certificate-manager');
  const store = new OPCUACertificateManager({rootFolder: process.env.OPCUA_PKI,
    automaticallyAcceptUnknownCertificate: true});
  await store.initialize();
  const options = {clientCertificateManager: store, applicationName: 'test',
    securityMode: opcua.MessageSecurityMode.SignAndEncrypt,
    securityPolicy: opcua.SecurityPolicy.Basic256Sha256};
  if (process.env.OPCUA_EXPIRED) {
    options.certificateFile = `${process.env.OPCUA_PKI}/expired.pem`;
    options.privateKeyFile = store.privateKey;
    // The same one at each call, so that it can be trusted.
    if (!existsSync(options.certificateFile)) await store.createSelfSignedCertificate({applicationUri: 'urn:test', subject: '/CN=old', dns: ['localhost'],
      startDate: new Date('2020-01-01'), validity: 30, outputFile: options.certificateFile});
  }
  return options;
}
const client = opcua.OPCUAClient.create({endpointMustExist: false, connectionStrategy: {maxRetry: 0},
  ...process.env.OPCUA_PKI ? await secured() : {}});
await client.connect(`opc.tcp://127.0.0.1:${port}`);
const login = name => client.createSession(name && {type: opcua.UserTokenType.UserName,
  userName: name, password: process.env.OPCUA_PASSWORD});
const session = await login(process.env.OPCUA_USER);
const index = (await session.readNamespaceArray()).indexOf('urn:fdi:valves');
const nodeOf = name => `ns=${index};s=${name}`;
const read = name => session.read({nodeId: nodeOf(name), attributeId: AttributeIds.Value});
const textOf = ({value, statusCode}) => `${statusCode.name} ${value?.value ?? ''}`;

async function childOf(nodeId, name) {
  const {references} = await session.browse({nodeId, resultMask: 63});
  return references.find(one => one.browseName.name === name)?.nodeId;
}
const call = async (objectId, methodId, ...inputArguments) =>
  (await session.call({objectId, methodId, inputArguments})).statusCode.name;
const eventArguments = (event, text) => [{dataType: DataType.ByteString, value: event},
  {dataType: DataType.LocalizedText, value: {text}}];

async function alarmOf(valve) {
  const list = await opcua.installAlarmMonitoring(session);
  for (const end = Date.now() + patienceMs; Date.now() < end; await wait(50)) {
    const alarm = list.alarms().find(one => one.getRetain() && one.fields.sourceName.value === valve);
    if (alarm) return alarm;
  }
  throw Error(`no alarm of ${valve}`);
}

// Without a user that may act nothing changes, and nonsense has an answer.
async function hostile(valve) {
  const write = await session.write({nodeId: nodeOf(`${valve}/DeviceHealth`), attributeId: AttributeIds.Value,
    value: {value: {dataType: DataType.Int32, value: 0}}});
  assert.equal(write, StatusCodes.BadNotWritable);
  const {conditionId, eventId} = await alarmOf(valve);
  for (const [name, ...inputs] of [['Acknowledge', ...eventArguments(eventId, 'x')],
    ['AddComment', ...eventArguments(eventId, 'x')], ['Disable'], ['Enable']])
    for (const method of [await childOf(conditionId, name), {Acknowledge: 'i=9111', AddComment: 'i=9029',
      Disable: 'i=9028', Enable: 'i=9027'}[name]])
      assert.equal(await call(conditionId, method, ...inputs), 'BadUserAccessDenied', name);
  const shelving = await childOf(conditionId, 'ShelvingState');
  for (const [name, ...inputs] of [['TimedShelve', {dataType: DataType.Double, value: 1000}], ['Unshelve'],
    ['OneShotShelve']])
    assert.equal(await call(shelving, await childOf(shelving, name), ...inputs), 'BadUserAccessDenied', name);
  for (const property of ['Retain', 'Comment', 'Severity', 'EnabledState', 'AckedState', 'ConditionName']) {
    const nodeId = await childOf(conditionId, property);
    const {value} = await session.read({nodeId, attributeId: AttributeIds.Value});
    const answer = await session.write({nodeId, attributeId: AttributeIds.Value, value: {value}});
    assert.ok(answer.isNotGood(), `${property} can be written`);
  }
  if (!process.env.OPCUA_PASSWORD) return print('refused');
  await session.close();
  const bad = async name => login(name).then(() => 'in', error => error.message);
  assert.match(await bad('otto\nanna'), /BadUserAccessDenied|BadIdentityTokenRejected/);
  // One that may: nonsense has an answer, and the history nothing of it.
  const anna = await login('anna');
  const ask = async (...inputs) => (await anna.call({objectId: conditionId,
    methodId: await childOf(conditionId, 'Acknowledge').catch(() => 'i=9111') ?? 'i=9111',
    inputArguments: inputs})).statusCode.name;
  assert.equal(await ask(...eventArguments(Buffer.from('0102', 'hex'), 'x')), 'BadEventIdUnknown');
  assert.equal(await ask(...eventArguments(null, 'x')), 'BadEventIdUnknown');
  assert.equal(await ask(...eventArguments(eventId, 'a\0b')), 'BadInvalidArgument');
  assert.equal(await ask(...eventArguments(eventId, 'x'.repeat(3000))), 'BadInvalidArgument');
  const shelve = async value => (await anna.call({objectId: shelving,
    methodId: 'i=2949', inputArguments: [{dataType: DataType.Double, value}]})).statusCode.name;
  for (const value of [-1, 0, NaN, Infinity, 1e300])
    assert.equal(await shelve(value), 'BadShelvingTimeOutOfRange', String(value));
  assert.equal((await anna.call({objectId: conditionId, methodId: 'i=9029',
    inputArguments: eventArguments(eventId, 'x')})).statusCode.name, 'BadNotSupported');
  // Two at once: one of them has acknowledged.
  const both = await Promise.all([1, 2].map(i => ask(...eventArguments(eventId, `call ${i}`))));
  assert.deepEqual(both.sort(), ['BadConditionBranchAlreadyAcked', 'Good']);
  await anna.close();
  print('refused');
}

if (verb === 'read') {
  for (const name of args) print(`${name} ${textOf(await read(name))}`);
} else if (verb === 'await') {
  let seen;
  for (const end = Date.now() + patienceMs; seen !== args[1]; await wait(100)) {
    if (Date.now() > end) throw Error(`${args[0]} is ${seen}, not ${args[1]}`);
    seen = textOf(await read(args[0]));
  }
  print(`${args[0]} ${seen}`);
} else if (verb === 'follow') {
  const subscription = await session.createSubscription2({requestedPublishingInterval: 100, publishingEnabled: true});
  const item = await subscription.monitor({nodeId: nodeOf(args[0]), attributeId: AttributeIds.Value},
    {samplingInterval: 0, queueSize: 1000}, opcua.TimestampsToReturn.Both);
  item.on('changed', value => print(textOf(value)));
  await wait(1000 * args[1]);
} else if (verb === 'acknowledge') {
  const {conditionId, eventId} = await alarmOf(args[0]);
  const called = Date.now();
  assert.equal(await session.acknowledgeCondition(conditionId, eventId, args[0]), StatusCodes.Good);
  print(called);
} else {
  await hostile(args[0]);
}
await Promise.race([client.disconnect().catch(() => {}), wait(2000)]);
process.exit(0);
