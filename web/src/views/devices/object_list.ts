/** Object dictionary of a device: loaded in pages, searched, with favourites. */

import { computed, signal } from "@preact/signals";
import type { Connection } from "../../connection.ts";
import { objectKey } from "../../logic/format.ts";
import { notifyError } from "../../notices.ts";
import type { Device, ObjectEntry, ObjectPage, ObjectValue } from "../../remote.ts";

const PAGE = 200; // entries
const FAVOURITES = "catenary.favourites"; // of all devices, by vendor and product

export interface Reading {
  text: string;
  value: ObjectValue["value"];
  failed: boolean;
}

export class ObjectList {
  readonly entries = signal<readonly ObjectEntry[]>([]);
  readonly next = signal<ObjectPage["next"]>(null);
  readonly notes = signal<readonly string[]>([]);
  readonly loading = signal(false);
  readonly search = signal("");
  readonly onlyFavourites = signal(false);
  readonly favourites = signal<ReadonlySet<string>>(new Set());
  readonly readings = signal<ReadonlyMap<string, Reading>>(new Map());
  readonly shown = computed(() =>
    filtered(this.entries.value, this.search.value).filter(
      (entry) => !this.onlyFavourites.value || this.favourites.value.has(keyOf(entry)),
    ),
  );
  private readonly connection: Connection;
  private readonly device: Device;

  constructor(connection: Connection, device: Device) {
    this.connection = connection;
    this.device = device;
    this.favourites.value = new Set(storedFavourites()[productOf(device)] ?? []);
  }

  /** Load the next page. While the list is filtered, load pages until the end. */
  async load(): Promise<void> {
    if (this.loading.value) return;
    this.loading.value = true;
    try {
      do await this.loadPage();
      while (this.isFiltered() && this.next.value !== null);
    } catch (error) {
      notifyError(error);
    }
    this.loading.value = false;
  }

  /** Change the search text, and load the whole dictionary to search in it. */
  find(text: string): void {
    this.search.value = text;
    this.loadRest();
  }

  toggleOnlyFavourites(): void {
    this.onlyFavourites.value = !this.onlyFavourites.value;
    this.loadRest();
  }

  async read(entry: ObjectEntry): Promise<void> {
    const { index, subindex } = entry;
    const params = { position: this.device.position, index, subindex };
    try {
      const { text, value } = await this.connection.call<ObjectValue>("sdo_read", params);
      this.note(entry, { text, value, failed: false });
    } catch (error) {
      const text = error instanceof Error ? error.message : String(error);
      this.note(entry, { text, value: null, failed: true });
    }
  }

  /** Read entries one after the other. */
  async readAll(entries: readonly ObjectEntry[]): Promise<void> {
    for (const entry of entries) {
      if (entry.access.includes("r")) await this.read(entry);
    }
  }

  /** Write a value, and read the entry again. Throws RemoteError. */
  async write(entry: ObjectEntry, value: number | boolean | string): Promise<void> {
    const { index, subindex, type } = entry;
    const params = { position: this.device.position, index, subindex, value, type };
    await this.connection.call("sdo_write", params);
    if (entry.access.includes("r")) await this.read(entry);
  }

  toggleFavourite(entry: ObjectEntry): void {
    const changed = new Set(this.favourites.value);
    const key = keyOf(entry);
    if (!changed.delete(key)) changed.add(key);
    this.favourites.value = changed;
    const all = { ...storedFavourites(), [productOf(this.device)]: [...changed] };
    localStorage.setItem(FAVOURITES, JSON.stringify(all));
  }

  private isFiltered(): boolean {
    return this.search.value !== "" || this.onlyFavourites.value;
  }

  private loadRest(): void {
    if (this.isFiltered() && this.next.value !== null) void this.load();
  }

  private async loadPage(): Promise<void> {
    const params = { position: this.device.position, after: this.next.value, count: PAGE };
    const page = await this.connection.call<ObjectPage>("objects", params);
    this.entries.value = [...this.entries.value, ...page.entries];
    this.next.value = page.next;
    this.notes.value = [...new Set([...this.notes.value, ...page.notes])];
  }

  private note(entry: ObjectEntry, reading: Reading): void {
    this.readings.value = new Map(this.readings.value).set(keyOf(entry), reading);
  }
}

export function keyOf({ index, subindex }: ObjectEntry): string {
  return objectKey(index, subindex);
}

/** Return the entries that contain each word of a search text. */
export function filtered(entries: readonly ObjectEntry[], search: string): readonly ObjectEntry[] {
  const words = search.toLowerCase().split(/\s+/).filter(Boolean);
  if (words.length === 0) return entries;
  return entries.filter((entry) => {
    const text = `${keyOf(entry)} ${entry.object_name} ${entry.name} ${entry.type}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
}

function productOf({ vendor, product }: Device): string {
  return `${vendor}:${product}`;
}

function storedFavourites(): Record<string, string[]> {
  try {
    return JSON.parse(localStorage.getItem(FAVOURITES) ?? "{}") as Record<string, string[]>;
  } catch {
    return {};
  }
}
