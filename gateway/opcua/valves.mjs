// The valves in the address space: Objects/Valves/GROUP/VALVE with a variable for
// each part of a finding, and conditions for its alarms (alarms.mjs).
import opcua from 'node-opcua-client';

import {Alarms} from './alarms.mjs';

const {DataType, StatusCodes} = opcua;

// OPC 10000-100, DeviceHealthEnumeration.
const health = {NORMAL: 0, FAILURE: 1, CHECK_FUNCTION: 2, OFF_SPEC: 3, MAINTENANCE_REQUIRED: 4};
// 1 to 1000 in OPC 10000-5, in equal steps.
export const severities = {low: 250, medium: 500, high: 750, critical: 1000};

// The value of each variable in a state. DeviceHealth and Description are always good:
// that nobody judges the valve is known.
const variables = {
  DeviceHealth: {type: 'Int32', of: state => health[state.health] ?? health.CHECK_FUNCTION},
  Description: {type: 'String', of: state => state.reason ?? state.description ?? ''},
  Fault: {type: 'String', of: state => state.fault ?? ''},
  FaultName: {type: 'String', of: state => state.name ?? ''},
  Certainty: {type: 'String', of: state => state.certainty ?? ''},
  Strength: {type: 'Double', of: state => state.strength_pct ?? 0},
  Severity: {type: 'UInt16', of: state => severities[state.severity] ?? 0},
  Since: {type: 'DateTime', of: state => dateOf(state.since_utc)},
  Check: {type: 'String', of: state => state.check ?? ''},
};
const alwaysGood = ['DeviceHealth', 'Description'];

export function dateOf(text) {
  const date = new Date(text ?? NaN);
  return Number.isNaN(date.getTime()) ? null : date;
}

// An alarm outlasts its data as what was known last; nothing else does.
function statusOf(state) {
  if (!state.reason && health[state.health] !== undefined) return StatusCodes.Good;
  return state.certainty ? StatusCodes.UncertainLastUsableValue : StatusCodes.BadNoData;
}

// As the page groups valves: U1-FV of U1-FV-102.
function groupOf({group, valve_id: valve}) {
  return group || valve.replace(/[^\p{L}\p{N}]*\p{N}+\P{N}*$/u, '') || 'other';
}

// A part of a node's name: the id of a valve has no "/" in it.
const part = text => encodeURIComponent(text).replaceAll('%20', ' ');

export class Valves {
  #space;
  #namespace;
  #folder;
  #groups = new Map();
  #valves = new Map();  // {object, variables, alarms, state}
  #reason;

  constructor(space, operator) {
    this.#space = space;
    this.#namespace = space.registerNamespace('urn:fdi:valves');
    const objects = space.rootFolder.objects;
    this.#folder = this.#namespace.addObject({browseName: 'Valves', nodeId: 's=Valves',
      organizedBy: objects, typeDefinition: 'FolderType', eventNotifier: 1,
      notifierOf: objects.server});
    this.conditions = new Alarms(space, operator);
  }

  show(state) {
    this.#reason = null;
    let valve = this.#valves.get(state.valve_id);
    if (!valve) this.#valves.set(state.valve_id, valve = this.#add(state));
    const status = statusOf(state);
    for (const [name, {type, of}] of Object.entries(variables)) {
      const value = of(state);
      valve.variables[name].setValueFromSource({dataType: DataType[type], value},
        alwaysGood.includes(name) ? StatusCodes.Good :
        value === null && status === StatusCodes.Good ? StatusCodes.GoodNoData : status);
    }
    valve.state = state;
    this.conditions.show(valve, state.alarms, status);
  }

  // Nothing that was told counts any more.
  silence(reason) {
    if (this.#reason === reason) return;
    for (const {state} of this.#valves.values())
      this.show({...state, health: 'CHECK_FUNCTION', reason});
    this.#reason = reason;
  }

  // Names of people are no QualifiedName: "3:V1" has no namespace in it.
  #named(name) {
    return {displayName: name, browseName: {namespaceIndex: this.#namespace.index, name}};
  }

  #add(state) {
    const id = state.valve_id;
    const name = groupOf(state);
    if (!this.#groups.has(name))
      this.#groups.set(name, this.#namespace.addObject({...this.#named(name),
        nodeId: `s=Valves/${part(name)}`, organizedBy: this.#folder,
        typeDefinition: 'FolderType', eventNotifier: 1, notifierOf: this.#folder}));
    const group = this.#groups.get(name);
    const object = this.#namespace.addObject({...this.#named(id), nodeId: `s=${part(id)}`,
      organizedBy: group, eventNotifier: 1, eventSourceOf: group});
    const made = {};
    for (const [browseName, {type}] of Object.entries(variables))
      made[browseName] = this.#namespace.addVariable({browseName,
        nodeId: `s=${part(id)}/${browseName}`, componentOf: object,
        dataType: browseName === 'DeviceHealth' ? this.conditions.healthType : type,
        accessLevel: 'CurrentRead', userAccessLevel: 'CurrentRead', minimumSamplingInterval: 0});
    return {object, variables: made, id, part: part(id), slots: []};
  }
}
