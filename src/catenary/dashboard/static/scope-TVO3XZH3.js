import{n as a,o as b,p as c}from"./chunk-GESKBWVN.js";import"./chunk-4SJATMPB.js";import"./chunk-BYXBJQAS.js";export{a as Scope,b as useFrames,c as useTheme};
