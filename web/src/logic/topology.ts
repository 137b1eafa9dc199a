/** Layout of devices as wired: one row per device, one column per branch. */

export interface Wired {
  position: number;
  parent: number | null;
  parent_port: number | null;
  ports: readonly { port: number; link: boolean; loop_closed: boolean }[];
}

export interface Node {
  position: number;
  row: number;
  column: number;
  parent: number | null; // row of the parent; null: the MainDevice
}

/** Order in which a frame leaves the ports of a device, ETG.1000.4: 3, 1, 2. */
const PORT_ORDER = [3, 1, 2, 0];

/**
 * Return the devices in wiring order. The last branch of a device continues in its column; each branch
 * before it begins a column of its own.
 */
export function layout(devices: readonly Wired[]): Node[] {
  const known = new Set(devices.map((device) => device.position));
  const children = new Map<number | null, Wired[]>();
  for (const device of devices) {
    const parent = device.parent !== null && known.has(device.parent) ? device.parent : null;
    children.set(parent, [...(children.get(parent) ?? []), device]);
  }
  const nodes: Node[] = [];
  const stack = (children.get(null) ?? [])
    .map((device) => ({ device, column: 0, parent: null as number | null }))
    .reverse();
  for (let next = stack.pop(); next !== undefined; next = stack.pop()) {
    const { device, column, parent } = next;
    const row = nodes.length;
    nodes.push({ position: device.position, row, column, parent });
    const below = [...(children.get(device.position) ?? [])].sort(byPort).reverse();
    below.forEach((child, rank) =>
      stack.push({ device: child, column: column + rank, parent: row }),
    );
  }
  return nodes;
}

/** Return the ports with a link to something that is not a device of the tree: a redundant line. */
export function openLinks(device: Wired, devices: readonly Wired[]): number[] {
  const used = new Set(
    devices.filter((each) => each.parent === device.position).map((each) => each.parent_port),
  );
  const upstream = 0; // frames arrive at port 0
  return device.ports
    .filter(({ port, link, loop_closed }) => link && !loop_closed && port !== upstream && !used.has(port))
    .map(({ port }) => port);
}

function byPort(a: Wired, b: Wired): number {
  const rank = (port: number | null) => (port === null ? 4 : PORT_ORDER.indexOf(port));
  return rank(a.parent_port) - rank(b.parent_port) || a.position - b.position;
}
