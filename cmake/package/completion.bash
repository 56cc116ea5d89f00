# bash completion of fdi-monitor and the other programs of fdi. Verbs, options
# and words come from the programs' --help-all, ids from fdi-store.

# Values of KEY in what fdi-store lists: _fdi_listed KEY ARGUMENTS...
_fdi_listed() {
  local key=$1 store=fdi-store
  shift
  [[ $program != */* ]] || store=${program%/*}/fdi-store
  timeout 2 "$store" "${data[@]}" "$@" --json 2>/dev/null |
    sed -n "s/^ *\"$key\": \"\(.*\)\",\{0,1\}\$/\1/p" | sort -u
}

# Faults of the catalogue, without the findings of the floor.
_fdi_faults() {
  _fdi_listed fault faults | grep -vE '_|^unknown$'
}

# Offers the lines that begin with WORD, as the shell has to read them. Names
# hold what their owners like: compgen -W would execute a $(command) in them.
_fdi_offer() {  # WORD [BEFORE]
  local line
  while IFS= read -r line; do
    printf -v line %q "$line"
    [[ $line != "$1"* ]] || COMPREPLY+=("$2$line")
  done
}

# The headings in a section of the help of `program $path`.
_fdi_section() {
  "$program" $path --help-all 2>/dev/null |
    sed -n "/^$1:/,/^\$/ s/^  \([^ ].*\)/\1/p"
}

_fdi_options() {
  _fdi_section Options | grep -o -e '^\(-[a-z], \)*--[a-z-]*' | grep -o -e '--.*'
}

# The help of option $1 of the verb, or else of the program, in one line that
# begins behind its name: " VALUE  Text", "[=VALUE]  Text", "  Text" of a flag.
_fdi_entry() {
  local path=$path
  while :; do
    "$program" $path --help-all 2>/dev/null | awk -v name="$1" '
      /^  [^ ]/ || /^$/ { found = 0 }
      match($0, "^  (-., )?" name "([[ ]|$)") {
        found = 1
        sub("^  (-., )?" name, "")
      }
      found { sub(/^      +/, "  "); printf "%s", $0 }' | grep . && return
    [[ $path ]] || return 1
    path=
  done
}

# The candidates for a value: _fdi_candidates NAME ENTRY
_fdi_candidates() {
  local value=${2%%  *} words
  words=$(grep -oE '[a-z0-9_-]+(\|[a-z0-9_-]+)+' <<<"$2" | head -1)
  case "$1 $value" in
    *SPEC* | fault\ *) _fdi_faults ;;
    valve\ * | valves\ *)
      _fdi_listed pattern valves list
      _fdi_listed valve_id history list
      _fdi_listed valve_id runs list
      ;;
    *NAME\[@VERSION\]* | model-set\ * | parent\ *)
      _fdi_listed model_set models list
      ;;
    *ID\[@* | run\ * | runs\ *) _fdi_listed run_id runs list ;;
    episode\ * | episodes\ *)
      echo last
      _fdi_listed episode_id history list --rows 100
      ;;
    type\ *) _fdi_listed name types list ;;
    label\ *)
      printf '%s\n' true false
      _fdi_faults
      ;;
    *) [[ ! $words ]] || tr '|' '\n' <<<"$words" ;;
  esac
}

# Completes $word as a value of NAME; lists grow after their last comma.
_fdi_value() {
  local name=$1 entry=$2 value=${2%%  *} before= last=$word how=()
  case "$name $value" in
    *DIR*) how=(-d) ;;
    *FILE* | output\ *) how=(-f) ;;
  esac
  if [[ ${how[*]} ]]; then
    compopt -o filenames
    mapfile -t COMPREPLY < <(compgen "${how[@]}" -- "$word")
    [[ $value != *\|* ]] ||
      _fdi_offer "$word" < <(_fdi_candidates "$name" "$entry")
    return
  fi
  if [[ $value == *SPEC* ]]; then
    compopt -o nospace
    if [[ $colon ]]; then
      _fdi_offer "$word" < <(printf '%s\n' abrupt@ incipient@)
    else
      _fdi_offer "$word" < <(_fdi_candidates "$name" "$entry" | sed 's/$/:/')
    fi
    return
  fi
  if [[ $word == *,* ]]; then
    before=${word%,*},
    last=${word##*,}
  fi
  _fdi_offer "$last" "$before" < <(_fdi_candidates "$name" "$entry")
}

_fdi_complete() {
  local program=$1 word=${COMP_WORDS[COMP_CWORD]} path= option= entry= colon=
  local i given count=0 data=() arguments=()
  local verbs=" $(_fdi_section Verbs | cut -d' ' -f1 | tr '\n' ' ')"
  COMPREPLY=()
  [[ $word != : && ${COMP_WORDS[COMP_CWORD - 1]} != : ]] || colon=1
  [[ $word != [=:] ]] || word=
  for ((i = 1; i < COMP_CWORD; i++)); do
    given=${COMP_WORDS[i]}
    if [[ $given == [=:@] || ${COMP_WORDS[i - 1]} == [:@] ]]; then
      continue
    elif [[ $option ]]; then
      [[ $option != --data ]] || data=(--data "${given/#\~\//$HOME/}")
      [[ $colon ]] || option=
    elif [[ $given == -* ]]; then
      entry=$(_fdi_entry "$given")
      [[ ! $entry || $entry == '  '* ]] || option=$given
    elif [[ $verbs == *" $given "* ]]; then
      path+=" $given"
      verbs=" $(_fdi_section Verbs | cut -d' ' -f1 | tr '\n' ' ')"
    else
      ((++count))
    fi
  done
  if [[ $option ]]; then
    entry=$(_fdi_entry "$option")
    _fdi_value "${option#--}" "${entry# }"
  elif [[ $word == -* ]]; then
    mapfile -t COMPREPLY < <(
      compgen -W "$(_fdi_options; path= _fdi_options)" -- "$word")
  elif [[ $verbs != ' ' ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$verbs" -- "$word")
  else
    mapfile -t arguments < <(_fdi_section Arguments)
    ((count < ${#arguments[@]})) || count=$((${#arguments[@]} - 1))
    ((count < 0)) ||
      _fdi_value "${arguments[count]%% *}" "${arguments[count]#* }"
  fi
}
complete -F _fdi_complete fdi-monitor fdi-simulator fdi-store fdi-trainer \
  fdi-gateway
