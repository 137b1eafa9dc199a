// Build the operator's page into src/catenary/dashboard/static, or into the folder given as argument.

import { readFileSync, readdirSync, mkdirSync, rmSync, writeFileSync, copyFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";

const LIMIT_KB = 250; // gzip, all scripts and styles
const web = dirname(fileURLToPath(import.meta.url));
const out = resolve(process.argv[2] ?? join(web, "../src/catenary/dashboard/static"));

/** Return the licence texts of the libraries in the bundle. */
function licences() {
  const packages = ["preact", "@preact/signals", "@preact/signals-core", "uplot", "three"];
  return packages
    .map((name) => {
      const folder = join(web, "node_modules", name);
      const { version } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
      const file = readdirSync(folder).find((each) => /^licen[cs]e/i.test(each));
      return `${name} ${version}\n\n${readFileSync(join(folder, file), "utf8").trim()}\n`;
    })
    .join(`\n${"-".repeat(80)}\n\n`);
}

/** Print the size of each file, and return the sum of the compressed sizes [kB]. */
function sizes() {
  let sum = 0;
  for (const file of readdirSync(out).filter((each) => /\.(js|css)$/.test(each)).sort()) {
    const data = readFileSync(join(out, file));
    const kb = gzipSync(data, { level: 9 }).length / 1000;
    console.log(`${file.padEnd(28)} ${(data.length / 1000).toFixed(1).padStart(7)} kB  gzip ${kb.toFixed(1).padStart(6)} kB`);
    sum += kb;
  }
  console.log(`total gzip ${sum.toFixed(1)} kB, limit ${LIMIT_KB} kB`);
  return sum;
}

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
await build({
  absWorkingDir: web,
  entryPoints: { app: "src/app.tsx" },
  outdir: out,
  bundle: true,
  format: "esm",
  splitting: true,
  chunkNames: "[name]-[hash]",
  minify: true,
  target: "es2022",
  jsx: "automatic",
  jsxImportSource: "preact",
  charset: "utf8",
  legalComments: "none",
  logLevel: "warning",
});
copyFileSync(join(web, "index.html"), join(out, "index.html"));
copyFileSync(join(web, "icon.svg"), join(out, "icon.svg"));
writeFileSync(join(out, "licenses.txt"), licences());
if (sizes() > LIMIT_KB) {
  console.error("the bundle exceeds its limit");
  process.exitCode = 1;
}
