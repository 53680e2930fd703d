// Bundles src/ with three.js into player.bundle.js, marked with the hash of what it was made from.
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";

const hash = createHash("sha256");
const sources = readdirSync("src").sort().map((name) => `src/${name}`);
for (const name of [...sources, "package.json"]) {
  hash.update(readFileSync(name, "utf8").replaceAll("\r\n", "\n"));
}

await build({
  entryPoints: ["src/main.js"],
  outfile: "player.bundle.js",
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2020", "safari15"],
  charset: "ascii",
  legalComments: "inline",
  banner: { js: `/* sources ${hash.digest("hex")} */` },
});
