# Prints the demo's rows of a table of compile_modules.cpp as Markdown, a column for each GPU:
# registers / spills / scratch / lanes / instructions; of NVIDIA's registers / local bytes / warps.
BEGIN { FS = "\t" }
/^#/ { print "Mesa " substr($0, 3) ":\n"; next }
$2 != "demo" { next }
{
  if (!($1 in column)) { column[$1] = ++columns; gpus[columns] = $1 }
  if (!($3 in row)) { row[$3] = ++rows; passes[rows] = $3 }
  spills = $5 < 0 ? "" : $5 " / "
  cell[$3, $1] = $4 " / " spills $6 " / " $7 " / " $8
}
END {
  printf "| pass |"
  for (i = 1; i <= columns; ++i) printf " %s |", gpus[i]
  printf "\n|---|"
  for (i = 1; i <= columns; ++i) printf "---|"
  print ""
  for (j = 1; j <= rows; ++j) {
    printf "| `%s` |", passes[j]
    for (i = 1; i <= columns; ++i) printf " %s |", cell[passes[j], gpus[i]]
    print ""
  }
}
