/** Topology as wired: one row per device, and the cables as lines at its left. */

import { duration, shortened } from "../../logic/format.ts";
import { portErrors, stateTone } from "../../logic/device_state.ts";
import { layout, openLinks, type Node } from "../../logic/topology.ts";
import { Chip } from "../../parts/common.tsx";
import type { Device } from "../../remote.ts";
import { address } from "../../route.ts";
import { text } from "../../strings.ts";

const ROW = 46; // height of a row, as in the style [px]
const COLUMN = 22;
const LEFT = 18; // centre of the first column

interface TreeProps {
  devices: Device[];
  chosen: number | undefined;
}

export function Tree({ devices, chosen }: TreeProps) {
  const nodes = layout(devices);
  const byPosition = new Map(devices.map((device) => [device.position, device]));
  const columns = Math.max(0, ...nodes.map(({ column }) => column)) + 1;
  const width = LEFT + columns * COLUMN;
  const redundant = devices.filter((device) => openLinks(device, devices).length > 0);
  const rows = nodes.length + 1 + (redundant.length > 0 ? 1 : 0);
  return (
    <div class="tree live">
      <svg class="cables" width={width} height={rows * ROW} aria-hidden="true">
        {nodes.map((node) => (
          <Cable key={node.position} node={node} nodes={nodes} broken={isBroken(byPosition, node.position)} />
        ))}
        {redundant.map(({ position }) => (
          <Return key={position} node={nodes.find((node) => node.position === position)} rows={rows} />
        ))}
        {nodes.map((node) => (
          <Mark key={node.position} node={node} device={byPosition.get(node.position)} />
        ))}
        <rect class="main-mark" x={LEFT - 7} y={ROW / 2 - 7} width={14} height={14} rx={3} />
      </svg>
      <ol class="tree-rows">
        <li class="tree-row main-row">{text.devices.main}</li>
        {nodes.map(({ position }) => {
          const device = byPosition.get(position);
          return device && <Row key={position} device={device} chosen={position === chosen} />;
        })}
        {redundant.length > 0 && <li class="tree-row main-row">{text.devices.redundant}</li>}
      </ol>
    </div>
  );
}

function x(column: number): number {
  return LEFT + column * COLUMN;
}

/** Return the middle of the row of a node; row −1 is the MainDevice. */
function y(row: number): number {
  return (row + 1.5) * ROW;
}

/** Cable from the parent of a device to it. */
function Cable({ node, nodes, broken }: { node: Node; nodes: Node[]; broken: boolean }) {
  const parent = node.parent === null ? undefined : nodes[node.parent];
  const from = parent === undefined ? { x: x(0), y: y(-1) } : { x: x(parent.column), y: y(parent.row) };
  const to = { x: x(node.column), y: y(node.row) };
  const turn = from.x === to.x ? "" : `V${from.y + ROW / 2}H${to.x}`;
  return <path class={broken ? "cable broken" : "cable"} d={`M${from.x} ${from.y}${turn}V${to.y}`} />;
}

/** Return whether the cable from the parent of a device carries no frames. */
function isBroken(devices: Map<number, Device>, position: number): boolean {
  const device = devices.get(position);
  if (device === undefined || device.lost || device.state === "") return true;
  const parent = device.parent === null ? undefined : devices.get(device.parent);
  return parent?.ports.find(({ port }) => port === device.parent_port)?.link === false;
}

/** Redundant cable from the last device back to the MainDevice. */
function Return({ node, rows }: { node: Node | undefined; rows: number }) {
  if (node === undefined) return null;
  return <path class="cable redundant" d={`M${x(node.column)} ${y(node.row)}V${(rows - 0.5) * ROW}H${x(0) - 10}`} />;
}

function Mark({ node, device }: { node: Node; device: Device | undefined }) {
  const tone = device === undefined ? "bad" : stateTone(device);
  return <circle class={`mark ${tone}`} cx={x(node.column)} cy={y(node.row)} r={6} />;
}

function Row({ device, chosen }: { device: Device; chosen: boolean }) {
  const errors = portErrors(device.ports);
  const axes = device.axes.filter((name) => name !== device.name).join(", ");
  return (
    <li>
      <a
        class="tree-row"
        href={address("devices", device.position)}
        aria-current={chosen ? "true" : undefined}
      >
        <span class="mono muted">{device.position}</span>
        <span class="grow tree-name">
          <span class={axes === "" ? "two-lines" : "cut"} title={device.name}>
            {shortened(device.name)}
          </span>
          {axes !== "" && <span class="small muted cut">{axes}</span>}
        </span>
        {errors > 0 && (
          <Chip tone="warn">
            {errors} {text.devices.errors}
          </Chip>
        )}
        <span class="small muted mono delay" title={text.devices.delay}>
          {device.delay_ns === null ? "" : duration(device.delay_ns * 1e-9)}
        </span>
        <Chip tone={stateTone(device)}>
          {device.state === "" ? text.devices.noAnswer : device.state}
        </Chip>
      </a>
    </li>
  );
}
